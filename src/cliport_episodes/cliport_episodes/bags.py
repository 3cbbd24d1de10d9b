"""The messages of any rosbag2 bag, whole or torn."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterator
from itertools import chain
from pathlib import Path

from rosbags.rosbag2 import Reader

from cliport_core.bag_library import open_reader
from cliport_core.bag_limits import TooMuchError
from cliport_core.torn_bag import whole_messages
from cliport_episodes.errors import BagError
from cliport_episodes.message_types import decode
from cliport_episodes.raw import RawMessage

__all__ = ["decode", "read_messages"]

_SUFFIXES = (".mcap", ".db3")
_log = logging.getLogger(__name__)


def read_messages(
    path: Path, topics: Collection[str] | None = None, complain: Callable[[str], None] = _log.warning
) -> Iterator[RawMessage]:
    """Yield the messages of a bag's folder or of one of its files, in the order of time.

    Reads sqlite3 and MCAP, with the metadata of Humble to Jazzy, or none. Of a torn or damaged bag the whole messages
    are yielded, and `complain` is called with one line about it. topics: only these; None: all.

    Raises:
        BagError: when there is no bag, nothing in it can be read, or it declares more than it may.
    """
    if not path.exists():
        raise BagError(f"there is no bag '{path}'")
    try:
        reader = open_reader(path)
    except TooMuchError as error:
        raise BagError(f"'{path}' is not read: {error}") from None
    except Exception as error:  # the library does not say what a damaged file may raise
        yield from _read_torn(path, topics, complain, one_line(error))
        return
    try:
        yield from _read_open(reader, topics, path.name, complain)
    finally:
        reader.close()


def one_line(error: BaseException) -> str:
    """Return the message of a library's error on one line without a full stop, to be part of a sentence."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__


def _read_open(
    reader: Reader, topics: Collection[str] | None, name: str, complain: Callable[[str], None]
) -> Iterator[RawMessage]:
    connections = [each for each in reader.connections if topics is None or each.topic in topics]
    count = 0
    try:
        for connection, stamp_ns, data in reader.messages(connections) if connections else ():
            yield RawMessage(connection.topic, connection.msgtype, bytes(data), stamp_ns, connection.msgdef.data)
            count += 1
    except Exception as error:  # as above
        complain(f"'{name}' is damaged ({one_line(error)}): the {count} messages before that are used")
        return
    announced = sum(connection.msgcount for connection in connections)
    if count != announced:
        complain(f"'{name}' announces {announced} messages: the {count} that it holds are used")


def _read_torn(
    path: Path, topics: Collection[str] | None, complain: Callable[[str], None], reason: str
) -> Iterator[RawMessage]:
    parts = []
    for file in path.iterdir() if path.is_dir() else [path]:
        first_and_rest = _first_and_rest(file, complain) if file.suffix in _SUFFIXES else None
        if first_and_rest is not None:
            parts.append(first_and_rest)
    if not parts or _has_compressed_messages(path):
        raise BagError(f"'{path}' is no bag that can be read: {reason}")
    count = 0
    for first, rest in sorted(parts, key=lambda part: part[0].stamp_ns):
        for message in chain([first], rest):
            count += 1
            if topics is None or message.topic in topics:
                yield message
    complain(f"'{path.name}' is not complete ({reason}): its {count} whole messages are used")


def _first_and_rest(file: Path, complain: Callable[[str], None]) -> tuple[RawMessage, Iterator[RawMessage]] | None:
    """Return the first message of a file that may be torn, and those after it; None where there are none."""
    messages = _whole_messages_of(file, complain)
    first = next(messages, None)
    return None if first is None else (first, messages)


def _whole_messages_of(file: Path, complain: Callable[[str], None]) -> Iterator[RawMessage]:
    try:
        if file.suffix == ".db3":  # the library would miss the write-ahead log that a killed recorder left beside it
            raise BagError(f"'{file.name}' may not be complete")
        reader = open_reader(file)
    except TooMuchError as error:
        raise BagError(f"'{file}' is not read: {error}") from None
    except Exception:  # as above
        try:
            for topic, stamp_ns, data in whole_messages(file):
                yield RawMessage(topic.name, topic.type, data, stamp_ns, topic.definition)
        except (OSError, ImportError, TooMuchError) as error:
            raise BagError(f"'{file}' cannot be read: {one_line(error)}") from None
        return
    try:
        yield from _read_open(reader, None, file.name, complain)
    finally:
        reader.close()


def _has_compressed_messages(path: Path) -> bool:
    try:
        return "compression_mode: message" in (path / "metadata.yaml").read_text(encoding="utf-8").lower()
    except (OSError, UnicodeDecodeError):
        return False
