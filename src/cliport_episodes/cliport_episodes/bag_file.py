"""One storage file of an episode: written as a whole or not at all, and described as metadata.yaml does."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import closing
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
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from cliport_core import topics
from cliport_core.bag_library import open_reader
from cliport_core.whole_file import sync
from cliport_episodes.bags import one_line
from cliport_episodes.disk import move
from cliport_episodes.errors import BagError
from cliport_episodes.message_types import definition_and_hash, types_of
from cliport_episodes.raw import RawMessage

SCRATCH = ".writing"  # subfolder of an episode in which a file is made
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
    """A topic of one file.

    type_hash: the hash of the message type as in REP 2016. offers: the publishers' QoS profiles; empty stands for
    ROS's defaults, reliable and volatile. count: number of messages.
    """

    name: str
    type: str
    type_hash: str
    offers: tuple[Qos, ...]
    count: int


@dataclass(frozen=True)
class BagFile:
    """Contents of a storage file; start_ns and end_ns: receipt times of its first and last message [ns]."""

    name: str
    start_ns: int
    end_ns: int
    topics: tuple[BagTopic, ...]

    @property
    def count(self) -> int:
        """Number of messages on all topics."""
        return sum(topic.count for topic in self.topics)


def write_bag_file(path: Path, messages: Sequence[RawMessage]) -> BagFile:
    """Write messages, at least one, to a new MCAP file that gets its name once it is complete and on the disk.

    Returns the contents of the new file.

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
            path.unlink(missing_ok=True)  # the rename may have happened without being on the disk
            raise
        return description
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def describe(path: Path) -> BagFile:
    """Return the contents of a complete file.

    Raises:
        BagError: when the file is not complete.
    """
    try:
        with closing(open_reader(path)) as reader:
            topics = []
            for each in reader.connections:
                type_hash = types_of(each.msgtype, each.msgdef.data).hash_rihs01(each.msgtype)
                offers = each.ext.offered_qos_profiles if isinstance(each.ext, ConnectionExtRosbag2) else ()
                topics.append(BagTopic(each.topic, each.msgtype, type_hash, tuple(offers), each.msgcount))
            return BagFile(path.name, reader.start_time, reader.end_time - 1, tuple(topics))
    except BagError:
        raise
    except Exception as error:  # the library does not say what a damaged file may raise
        raise BagError(f"'{path.name}' is not complete ({one_line(error)})") from None


def is_latched(topic: str) -> bool:
    """Return True if the topic's last message stays valid until the next one, however old it is."""
    return topic == topics.TF_STATIC
