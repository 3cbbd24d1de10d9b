"""One storage file of an episode: written as a whole or not at all, and described as metadata.yaml does."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rosbags.interfaces import (
    ConnectionExtRosbag2,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

from cliport_episodes.bags import one_line
from cliport_episodes.disk import move, sync
from cliport_episodes.errors import BagError
from cliport_episodes.message_types import definition_and_hash, types_of
from cliport_episodes.observation import TF_STATIC_TOPIC
from cliport_episodes.raw import RawMessage

SCRATCH = ".writing"  # the folder within an episode's in which a file is made
_NO_LIMIT = QosTime(9223372036, 854775807)  # as rosbag2 writes "infinite"
_LATCHED = Qos(
    history=QosHistory.KEEP_LAST,
    depth=1,
    reliability=QosReliability.RELIABLE,
    durability=QosDurability.TRANSIENT_LOCAL,
    deadline=_NO_LIMIT,
    lifespan=_NO_LIMIT,
    liveliness=QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_NO_LIMIT,
    avoid_ros_namespace_conventions=False,
)


@dataclass(frozen=True)
class BagTopic:
    """A topic of one file; type_hash as in REP 2016; offers: empty means ROS's defaults, reliable and volatile."""

    name: str
    type: str
    type_hash: str
    offers: tuple[Qos, ...]
    count: int


@dataclass(frozen=True)
class BagFile:
    """What a storage file holds; times are when its first and its last message were received [ns]."""

    name: str
    start_ns: int
    end_ns: int
    topics: tuple[BagTopic, ...]

    @property
    def count(self) -> int:
        """Messages on all topics."""
        return sum(topic.count for topic in self.topics)


def write_bag_file(path: Path, messages: Sequence[RawMessage]) -> BagFile:
    """Write messages, which are not empty, to a new MCAP file that is complete and on the disk when it has its name.

    Raises:
        OSError: when the disk refuses; there is no file then.
        BagError: when a message's type is not known.
    """
    scratch = path.parent / SCRATCH
    shutil.rmtree(scratch, ignore_errors=True)
    try:
        writer = Writer(scratch / path.stem, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            connections = {}
            for message in messages:
                key = (message.topic, message.type)
                if key not in connections:
                    definition, type_hash = definition_and_hash(message)
                    connections[key] = writer.add_connection(
                        message.topic,
                        message.type,
                        msgdef=definition,
                        rihs01=type_hash,
                        offered_qos_profiles=[_LATCHED] if is_latched(message.topic) else [],
                    )
                writer.write(connections[key], message.stamp_ns, message.data)
        made = scratch / path.stem / path.name
        description = describe(made)
        sync(made)
        try:
            move(made, path)
        except OSError:
            path.unlink(missing_ok=True)  # it has its name, and perhaps not for long
            raise
        return description
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def describe(path: Path) -> BagFile:
    """What a whole file holds.

    Raises:
        BagError: when it is not whole.
    """
    try:
        with Reader(path) as reader:
            topics = tuple(
                BagTopic(
                    each.topic,
                    each.msgtype,
                    types_of(each.msgtype, each.msgdef.data).hash_rihs01(each.msgtype),
                    tuple(each.ext.offered_qos_profiles) if isinstance(each.ext, ConnectionExtRosbag2) else (),
                    each.msgcount,
                )
                for each in reader.connections
            )
            return BagFile(path.name, reader.start_time, reader.end_time - 1, topics)
    except BagError:
        raise
    except Exception as error:  # the library does not say what a damaged file may raise
        raise BagError(f"'{path.name}' is not complete ({one_line(error)})") from None


def is_latched(topic: str) -> bool:
    """Whether a topic's last message holds until the next, however old it is."""
    return topic == TF_STATIC_TOPIC
