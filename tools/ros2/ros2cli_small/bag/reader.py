"""A bag that is being read, whole or torn: its topics, its times, its messages."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from rosbags.interfaces import Connection, ConnectionExtRosbag2, Qos

from ros2cli_small.bag.limits import HostileBag, open_reader
from ros2cli_small.bag.salvage import TornFile
from ros2cli_small.errors import CommandError

STORAGES = {".mcap": "mcap", ".db3": "sqlite3"}


@dataclass(frozen=True)
class BagTopic:
    """A topic in a bag; `offers` is what its publishers offered when it was recorded."""

    name: str
    type: str
    count: int
    encoding: str
    offers: tuple[Qos, ...]


class Bag:
    """An open bag. Times are nanoseconds since 1970; `end` is the last message's. An empty bag begins and ends at 0."""

    def __init__(self, path: Path, files: list[Path], parts: list[Any], ros_distro: str | None) -> None:
        self.path, self.files, self.ros_distro = path, files, ros_distro or "unknown"
        self._parts = parts
        self.message_count = sum(part.message_count for part in parts)
        self.start = min((part.start_time for part in parts), default=0) if self.message_count else 0
        self.end = max(part.end_time for part in parts) - 1 if self.message_count else 0
        self.topics: dict[str, BagTopic] = {}
        for connection in (each for part in parts for each in part.connections):
            self.topics[connection.topic] = _with(self.topics.get(connection.topic), connection)

    @property
    def storage(self) -> str:
        """The storage plugin's name; empty for a bag without files."""
        suffixes = (suffix for file in self.files for suffix in file.suffixes)
        return next((STORAGES[suffix] for suffix in suffixes if suffix in STORAGES), "")

    def messages(
        self, topics: Collection[str], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, time and serialized message in the order of time, from `start` to before `stop`.

        What is damaged ends it with a warning.
        """
        count = 0
        try:
            for part in self._parts:
                connections = [each for each in part.connections if each.topic in topics]
                for connection, time, data in part.messages(connections, start, stop) if connections else ():
                    count += 1
                    yield connection.topic, time, data
        except Exception as error:  # the library does not say what a damaged file may raise
            warn(f"Bag '{self.path}' is damaged ({_line(error)}): the {count} messages before that were read")

    def close(self) -> None:
        """Close the files."""
        for part in self._parts:
            part.close()


@contextmanager
def open_bag(path: Path, storage: str | None = None) -> Iterator[Bag]:
    """Open a bag's folder, or one of its files; a torn one opens as far as it goes, with a warning."""
    try:
        try:
            bag = _open_whole(path)
        except (HostileBag, CommandError):
            raise
        except Exception as error:  # as above
            bag = _open_torn(path, _line(error))
    except (HostileBag, OSError) as error:
        raise CommandError(f"Cannot read bag '{path}': {_line(error)}") from None
    try:
        if storage not in (None, bag.storage):
            raise CommandError(f"Bag '{path}' is stored as {bag.storage or 'nothing known'}, not as {storage}")
        yield bag
    finally:
        bag.close()


def warn(text: str) -> None:
    """Say in one line what is amiss."""
    print(f"WARNING: {text}", file=sys.stderr, flush=True)


def _open_whole(path: Path) -> Bag:
    if path.is_dir() and not (path / "metadata.yaml").exists():
        raise FileNotFoundError("it has no metadata.yaml")
    reader = open_reader(path)
    try:
        files = [path]
        if path.is_dir():
            metadata = yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
            files = [path / Path(name).name for name in metadata["relative_file_paths"]]
        return Bag(path, files, [reader], reader.ros_distro)
    except BaseException:
        reader.close()
        raise


def _open_torn(path: Path, reason: str) -> Bag:
    """Open what can be read of a bag that does not open; `reason` says why it does not."""
    files = _storage_files(path)
    try:
        compressed = "compression_mode: message" in (path / "metadata.yaml").read_text().lower()
    except OSError:
        compressed = False
    parts = [] if compressed else [_part(file) for file in files]
    bag = Bag(path, files, parts, None)
    if not bag.message_count:
        bag.close()
        raise CommandError(f"Cannot read bag '{path}': {reason}")
    warn(f"Bag '{path}' is not complete ({reason}): the {bag.message_count} messages that are whole are read")
    return bag


def _storage_files(path: Path) -> list[Path]:
    """Return the files of a bag that hold messages, in their order."""
    found = path.iterdir() if path.is_dir() else [path]
    return sorted((file for file in found if file.suffix in STORAGES), key=lambda file: (len(file.name), file.name))


def _part(file: Path) -> Any:
    try:
        # Of SQLite's files the library would not see what a killed recorder left beside them.
        if file.suffix == ".mcap":
            return open_reader(file)
    except HostileBag:
        raise
    except Exception:  # as above
        pass
    return TornFile(file)


def _with(known: BagTopic | None, connection: Connection) -> BagTopic:
    assert isinstance(connection.ext, ConnectionExtRosbag2)
    count = connection.msgcount + (known.count if known else 0)
    offers = known.offers if known else tuple(connection.ext.offered_qos_profiles)
    return BagTopic(connection.topic, connection.msgtype, count, connection.ext.serialization_format, offers)


def _line(error: Exception) -> str:
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__
