"""What can be read of a storage file that lacks its end: a recorder was killed, a copy broke off, a disk was full."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from backports import zstd
from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag2.storage_mcap import read_string

from cliport_episodes.raw import RawMessage

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F  # kinds of records, mcap.dev/spec


def whole_messages(path: Path) -> Iterator[RawMessage]:
    """Yield what lies before the tear, in the order in which it was written."""
    with suppress(Exception):  # what is torn may also be garbled, and then ends there
        yield from _sqlite3_messages(path) if path.suffix == ".db3" else _mcap_messages(path)


def _mcap_messages(path: Path) -> Iterator[RawMessage]:
    schemas = {0: ("", "")}
    channels: dict[int, tuple[str, str, str]] = {}
    with path.open("rb") as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            return
        for kind, record in _records(file, path.stat().st_size):
            stream = BytesIO(record)
            key = int.from_bytes(stream.read(2), "little")
            if kind == _SCHEMA:
                name, _, definition = read_string(stream), read_string(stream), read_string(stream)
                schemas[key] = (name, definition)
            elif kind == _CHANNEL:
                name, definition = schemas[int.from_bytes(stream.read(2), "little")]
                channels[key] = (read_string(stream), name, definition)
            elif kind == _MESSAGE:  # channel, 4 bytes of sequence number, log time, 8 bytes of publish time
                topic, name, definition = channels[key]
                yield RawMessage(topic, name, record[22:], int.from_bytes(record[6:14], "little"), definition)


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
    stream = BytesIO(chunk[28:])
    compression = stream.read(int.from_bytes(stream.read(4), "little"))
    records = stream.read()[8:]
    if compression == b"zstd":
        return zstd.ZstdDecompressor().decompress(records)
    if compression == b"lz4":
        return bytes(LZ4FrameDecompressor().decompress(records))
    return records if compression == b"" else b""


def _sqlite3_messages(path: Path) -> Iterator[RawMessage]:
    # Not read-only: SQLite takes back by itself what a killed recorder left half written.
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA writable_schema = ON")  # else it refuses a file that is shorter than it should be
        topics = {key: (name, kind) for key, name, kind in database.execute("SELECT id, name, type FROM topics")}
        for key, stamp_ns, data in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
            yield RawMessage(*topics[key], data, stamp_ns)
