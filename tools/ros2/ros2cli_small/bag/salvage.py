"""What can be read of a storage file that lacks its end: a recorder was killed, a copy broke off, a disk was full."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from backports import zstd
from lz4.frame import LZ4FrameDecompressor
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat, Qos
from rosbags.rosbag2.metadata import parse_qos
from rosbags.rosbag2.storage_mcap import get_qos, read_bytes, read_string

Message = tuple[Connection, int, bytes]

MCAP_MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 0x03, 0x04, 0x05, 0x06, 0x0F
NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")


class TornFile:
    """The messages before the tear, in the order in which they were written. Times are nanoseconds."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.start_time, self.end_time, self.message_count = 2**63 - 1, 0, 0
        found: dict[int, Connection] = {}
        for connection, time, _ in self._all():
            known = found.get(connection.id, connection)
            found[connection.id] = known._replace(msgcount=known.msgcount + 1)
            self.start_time, self.end_time = min(time, self.start_time), max(time + 1, self.end_time)
            self.message_count += 1
        self.connections = list(found.values())

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[Message]:
        """Yield the messages of some connections from `start` to before `stop`."""
        wanted = {connection.id for connection in connections}
        for connection, time, data in self._all():
            if connection.id in wanted and (start is None or time >= start) and (stop is None or time < stop):
                yield connection, time, data

    def close(self) -> None:
        """Do nothing: the file is open only while it is read."""

    def _all(self) -> Iterator[Message]:
        with suppress(Exception):  # what is torn may also be garbled, and then ends there
            yield from _sqlite3_messages(self.path) if self.path.suffix == ".db3" else _mcap_messages(self.path)


def _mcap_messages(path: Path) -> Iterator[Message]:
    types = {0: ""}
    connections: dict[int, Connection] = {}
    with path.open("rb") as file:
        if file.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
            return
        for kind, record in _mcap_records(file, path.stat().st_size):
            stream = BytesIO(record)
            key = int.from_bytes(stream.read(2), "little")
            if kind == SCHEMA:
                types[key] = read_string(stream)
            elif kind == CHANNEL:
                schema = int.from_bytes(stream.read(2), "little")
                topic, encoding, metadata = read_string(stream), read_string(stream), read_bytes(stream)
                connections[key] = _connection(key, topic, types[schema], encoding, get_qos(metadata))
            elif kind == MESSAGE:  # channel, 4 bytes of sequence number, log time, 8 bytes of publish time
                yield connections[key], int.from_bytes(record[6:14], "little"), record[22:]


def _mcap_records(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of whole records, a chunk's records in its place, up to the data's end or the tear."""
    while len(head := stream.read(9)) == 9:
        kind, length = head[0], int.from_bytes(head[1:], "little")
        content = stream.read(min(length, size))
        if kind == CHUNK:
            records = _chunk_records(content)
            yield from _mcap_records(BytesIO(records), len(records))
        elif len(content) == length and kind not in (0, DATA_END):
            yield kind, content
        if len(content) < length or kind in (0, DATA_END):
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


def _sqlite3_messages(path: Path) -> Iterator[Message]:
    # Not read-only: SQLite takes back by itself what a killed recorder left half written.
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA writable_schema = ON")  # else it refuses a file that is shorter than it should be
        database.row_factory = sqlite3.Row
        connections = {
            row["id"]: _connection(
                row["id"], row["name"], row["type"], row["serialization_format"],
                parse_qos(row["offered_qos_profiles"] if "offered_qos_profiles" in row.keys() else ""),  # noqa: SIM118
            )
            for row in database.execute("SELECT * FROM topics")
        }  # fmt: skip
        for topic, time, data in database.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
            yield connections[topic], time, data


def _connection(key: int, topic: str, kind: str, encoding: str, offers: list[Qos]) -> Connection:
    return Connection(key, topic, kind, NO_DEFINITION, "", 0, ConnectionExtRosbag2(encoding, offers), None)
