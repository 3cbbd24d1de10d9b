"""A bag that is being written: messages reach the disk every second, files are split on demand."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionMode
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from ros2cli_small.errors import CommandError

INFORMATION = "rosbag2_bagfile_information"


@dataclass(frozen=True)
class SplitLimits:
    """Limits at which the next file begins; 0 is never. `size` in bytes, `duration` in nanoseconds."""

    size: int = 0
    duration: int = 0


@dataclass(frozen=True)
class RecordedTopic:
    """A topic as the bag describes it."""

    name: str
    type: str
    definition: str
    type_hash: str
    offers: tuple[Qos, ...]


class _File(Writer):
    """One storage file in the bag's folder, named as rosbag2 names it: the library knows bags of one file only."""

    def __init__(self, folder: Path, number: int, plugin: StoragePlugin) -> None:
        super().__init__(folder / "new", version=9, storage_plugin=plugin)
        self.path, self.metapath, self._number = folder, folder / "metadata.yaml", number
        self.size = 0

    def open(self) -> None:
        storage: Any = self.STORAGE_PLUGINS[self.storage_plugin](self.path, CompressionMode.NONE)
        path = self.path / f"{self.path.name}_{self._number}{storage.path.suffix}"
        if isinstance(storage, Sqlite3Writer):
            storage.conn.close()
            storage.path.rename(path)
            storage.conn = sqlite3.connect(path)
            storage.cursor = storage.conn.cursor()
        else:
            storage.path.rename(path)
        storage.path = path
        self.storage = storage

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        super().write(connection, timestamp, data)
        self.size += len(data)

    def flush(self) -> None:
        """Hand to the system what was written; a process that is killed loses none of it."""
        if isinstance(self.storage, Sqlite3Writer):
            self.storage.conn.commit()
        elif isinstance(self.storage, McapWriter) and self.storage.chunk.msgs:
            self.storage.close_chunk()
            self.storage.bio.flush()

    def close(self) -> None:
        if isinstance(self.storage, McapWriter):  # where there are no messages the format wants 0 for the first time
            for span in (self.storage, self.storage.chunk):
                span.message_start_time = min(span.message_start_time, span.message_end_time)
        super().close()


class BagWriter:
    """Writes a rosbag2 folder. A disk that fails ends in a `CommandError`; what was flushed before stays readable."""

    def __init__(
        self,
        folder: Path,
        storage: str,
        limits: SplitLimits | None = None,
        custom_data: Mapping[str, str] | None = None,
    ) -> None:
        self._folder = folder.absolute()
        self._plugin = StoragePlugin[storage.upper()]
        self._limits = limits or SplitLimits()
        self._custom_data = dict(custom_data or {})
        self._topics: dict[str, RecordedTopic] = {}
        self._connections: dict[str, Connection] = {}
        self._closed: list[dict[str, Any]] = []
        with self._disk_errors():
            self._folder.mkdir(parents=True)
            self._file = self._open_file()

    def add_topic(self, topic: RecordedTopic) -> None:
        """Announce a topic before its first message."""
        with self._disk_errors():
            self._topics[topic.name] = topic
            self._connections[topic.name] = self._connect(topic)

    def write(self, topic: str, time: int, data: bytes) -> bool:
        """Add a serialized message received at `time` (ns); return whether a new file was begun for it."""
        with self._disk_errors():
            split = self._is_full(time)
            if split:
                self._close_file()
                self._file.metapath.unlink()  # it would hide the next file from who reads after a crash
                self._file = self._open_file()
                self._connections = {name: self._connect(each) for name, each in self._topics.items()}
            self._file.write(self._connections[topic], time, data)
        return split

    def flush(self) -> None:
        """Make everything so far safe from the end of this process."""
        with self._disk_errors():
            self._file.flush()

    def close(self) -> None:
        """Complete the last file and the bag's metadata."""
        with self._disk_errors():
            self._close_file()

    def _open_file(self) -> _File:
        file = _File(self._folder, len(self._closed), self._plugin)
        for key, value in self._custom_data.items():
            file.set_custom_data(key, value)
        file.open()
        return file

    def _connect(self, topic: RecordedTopic) -> Connection:
        return self._file.add_connection(
            topic.name, topic.type, msgdef=topic.definition, rihs01=topic.type_hash, offered_qos_profiles=topic.offers
        )

    def _is_full(self, time: int) -> bool:
        age = time - self._file.min_timestamp
        return 0 < self._limits.size <= self._file.size or 0 < self._limits.duration <= age

    def _close_file(self) -> None:
        self._file.close()
        path = self._file.metapath
        self._closed.append(yaml.safe_load(path.read_text())[INFORMATION])
        if len(self._closed) > 1:
            whole = path.with_suffix(".yaml.tmp")
            whole.write_text(yaml.safe_dump({INFORMATION: joined(self._closed)}, sort_keys=False))
            whole.replace(path)

    @contextmanager
    def _disk_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            with suppress(AttributeError, OSError, sqlite3.Error):  # the first file may not be there yet
                self._file.abort()
            reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
            raise CommandError(
                f"Cannot write to bag '{self._folder}': {reason}. What it had before can still be played."
            ) from None


def joined(files: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the metadata of a bag from that of its files."""
    recorded = [each for each in files if each["message_count"]] or files[:1]
    start = min(each["starting_time"]["nanoseconds_since_epoch"] for each in recorded)
    end = max(each["starting_time"]["nanoseconds_since_epoch"] + each["duration"]["nanoseconds"] for each in recorded)
    return {
        **files[-1],
        "relative_file_paths": [path for each in files for path in each["relative_file_paths"]],
        "files": [file for each in files for file in each["files"]],
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(each["message_count"] for each in files),
        "topics_with_message_count": [
            {**topic, "message_count": _count(files, topic["topic_metadata"]["name"])}
            for topic in files[-1]["topics_with_message_count"]
        ],
    }


def _count(files: Sequence[dict[str, Any]], name: str) -> int:
    topics = [topic for each in files for topic in each["topics_with_message_count"]]
    return sum(int(topic["message_count"]) for topic in topics if topic["topic_metadata"]["name"] == name)
