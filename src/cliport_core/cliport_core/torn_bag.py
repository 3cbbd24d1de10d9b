"""Messages of a storage file that lacks its end: a recorder was killed, a copy broke off, a disk was full.

The module stands on the caps of `bag_limits` alone, so that tools may take it.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from cliport_core.bag_limits import TooMuchError, decompress_lz4, decompress_zstd

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F  # kinds of records, mcap.dev/spec


class TornTopic(NamedTuple):
    """A topic in the file.

    key: its number there; type: as in "sensor_msgs/msg/Image"; encoding: of its messages, "cdr" as a rule.
    offered_qos: what its publishers offered, as rosbag2's YAML text; definition: its type's text. Both may be empty.
    """

    key: int
    name: str
    type: str
    encoding: str
    offered_qos: str
    definition: str


class TornMessage(NamedTuple):
    """A message: its topic, when it was logged [ns], its bytes."""

    topic: TornTopic
    stamp_ns: int
    data: bytes


def whole_messages(path: Path) -> Iterator[TornMessage]:
    """Yield what lies before the tear of an MCAP or SQLite (.db3) file, in the order in which it was written.

    Raises:
        OSError: when the file cannot be opened or read.
        ImportError: when the package is missing that decompresses it: backports.zstd or lz4.
        TooMuchError: when a chunk declares more than it may.
    """
    with path.open("rb"):  # SQLite does not say why it cannot open a file
        pass
    try:
        yield from _sqlite3_messages(path) if path.suffix == ".db3" else _mcap_messages(path)
    except (ImportError, OSError, TooMuchError):
        raise
    except Exception:  # what is torn may also be garbled, and then ends there
        return


def _mcap_messages(path: Path) -> Iterator[TornMessage]:
    schemas = {0: ("", "")}
    topics: dict[int, TornTopic] = {}
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return
        for kind, record in _records(file, path.stat().st_size):
            stream = BytesIO(record)
            key = int.from_bytes(stream.read(2), "little")
            if kind == _SCHEMA:
                name, _, definition = _text(stream), _text(stream), _text(stream)
                schemas[key] = name, definition
            elif kind == _CHANNEL:
                type_name, definition = schemas[int.from_bytes(stream.read(2), "little")]
                topic, encoding, metadata = _text(stream), _text(stream), _texts(stream)
                offers = metadata.get("offered_qos_profiles", "")
                topics[key] = TornTopic(key, topic, type_name, encoding, offers, definition)
            elif kind == _MESSAGE:  # channel, 4 bytes of sequence number, log time, 8 bytes of publish time
                yield TornMessage(topics[key], int.from_bytes(record[6:14], "little"), record[22:])


def _records(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of whole records, a chunk's records in its place, up to the data's end or the tear."""
    while len(head := stream.read(9)) == 9:
        kind, length = head[0], int.from_bytes(head[1:], "little")
        content = stream.read(min(length, size))
        if kind == _CHUNK:
            records = _chunk_records(content)
            yield from _records(BytesIO(records), len(records))
        elif len(content) == length and kind not in (0, _DATA_END):
            yield kind, content
        if len(content) < length or kind in (0, _DATA_END):
            return


def _chunk_records(chunk: bytes) -> bytes:
    """Return the records that are there of a chunk that may be torn. Two times, a size and a checksum come first."""
    size = int.from_bytes(chunk[16:24], "little")
    stream = BytesIO(chunk[28:])
    compression = stream.read(int.from_bytes(stream.read(4), "little"))
    records = stream.read()[8:]
    if compression == b"zstd":
        return decompress_zstd(records, size)
    if compression == b"lz4":
        return decompress_lz4(records, size)
    return records if compression == b"" else b""


def _bytes(stream: BinaryIO) -> bytes:
    """Return what follows its length of four bytes. Raises EOFError where it is cut off."""
    head = stream.read(4)
    content = stream.read(int.from_bytes(head, "little"))
    if len(head) < 4 or len(content) < int.from_bytes(head, "little"):
        raise EOFError("the record ends too early")
    return content


def _text(stream: BinaryIO) -> str:
    return _bytes(stream).decode()


def _texts(stream: BinaryIO) -> dict[str, str]:
    """Return a map of texts."""
    content = BytesIO(_bytes(stream))
    found: dict[str, str] = {}
    while content.tell() < len(content.getbuffer()):
        key = _text(content)
        found[key] = _text(content)
    return found


def _sqlite3_messages(path: Path) -> Iterator[TornMessage]:
    # Not read-only: SQLite takes back by itself what a killed recorder left half written.
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA writable_schema = ON")  # else it refuses a file that is shorter than it should be
        columns = {row[1] for row in database.execute("PRAGMA table_info(topics)")}
        offers = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
        rows = database.execute(f"SELECT id, name, type, serialization_format, {offers} FROM topics")
        topics = {key: TornTopic(key, name, kind, form, offer, "") for key, name, kind, form, offer in rows}
        for key, stamp_ns, data in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
            yield TornMessage(topics[key], stamp_ns, data)
