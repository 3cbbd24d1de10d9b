"""Caps on what a bag from elsewhere may declare, checked before anything is decompressed.

18 kB of compressed zeros can declare gigabytes, and some hundred bytes of YAML aliases expand to hundreds of megabytes.
"""

from __future__ import annotations

import shutil
import struct
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, BinaryIO

import rosbags.rosbag2.metadata as bag_metadata
import rosbags.rosbag2.reader as bag_reader
import rosbags.rosbag2.storage_mcap as bag_mcap
import yaml
from backports import zstd
from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag2.errors import ReaderError
from ruamel.yaml import YAML

from ros2cli_small.errors import CommandError

MEBIBYTE = 1 << 20
MAX_CHUNK = 256 * MEBIBYTE  # uncompressed; recorders write chunks of 1 MiB, or of one message where that is larger
MAX_TOGETHER = 1024 * MEBIBYTE  # of chunks that overlap in time, and so are held at the same time
MAX_MESSAGE = MAX_CHUNK  # of a message that is compressed by itself
MAX_YAML = 4 * MEBIBYTE  # bytes; a bag of a thousand topics has 1 MiB
MAX_YAML_DEPTH = 50
_MCAP_MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _FOOTER = 0x06, 0x02
_LONGEST_NAME = 16  # bytes of a compression's name that are read
_FRAME_HEADER = 18  # bytes, at most, of a Zstandard frame
_LZ4_FACTOR = 255  # that LZ4 cannot compress better than
_OUTPUT_STEP = 1 << 16  # bytes decompressed at a time where only the length counts


class TooMuch(ReaderError):
    """A bag declares, or holds, more than it may."""


def guard_library() -> None:
    """Put the caps into the bag library, which has none: its decompressors and its YAML."""
    bag_mcap.DECOMPRESSORS.update({"zstd": _zstd_chunk, "lz4": _lz4_chunk})
    replacements: tuple[tuple[ModuleType, str, Any], ...] = (
        (bag_metadata, "YAML", _PlainYaml),
        (bag_reader, "YAML", _PlainYaml),
        (bag_reader, "zstd", SimpleNamespace(decompress=_zstd_message, open=_BoundedFile)),
    )
    for module, name, replacement in replacements:
        if not hasattr(module, name):
            raise CommandError(f"The library 'rosbags' has changed: {module.__name__} has no {name} to put caps on")
        setattr(module, name, replacement)


def check_file(path: Path) -> None:
    """Refuse an MCAP file whose chunks declare too much, or hold another amount than they declare."""
    if path.suffix != ".mcap":
        return
    with path.open("rb") as file:
        for chunk in _chunks(file, path.stat().st_size):
            place = f"the chunk at byte {chunk.offset}"
            _check_chunk_size(chunk.size, place)
            next_record = file.tell()
            if _held_size(file, chunk) > chunk.size:
                raise TooMuch(f"{place} declares {_amount(chunk.size)} and holds more")
            file.seek(next_record)


def check_overlap(chunks: Iterable[Any]) -> None:
    """Refuse an index of chunks of which too many overlap in time: all of those are decompressed together."""
    moments: list[tuple[int, int, int]] = []
    for chunk in chunks:
        _check_chunk_size(chunk.uncompressed_size, f"the chunk at byte {chunk.chunk_start_offset}")
        moments.append((chunk.message_start_time, 0, chunk.uncompressed_size))
        moments.append((chunk.message_end_time, 1, -chunk.uncompressed_size))
    together = 0
    for _, _, size in sorted(moments):
        together += size
        if together > MAX_TOGETHER:
            raise TooMuch(f"chunks that overlap in time declare more than {_amount(MAX_TOGETHER)}")


def check_yaml(text: str) -> None:
    """Refuse YAML that is long, deep, or has aliases: recorders write none."""
    if len(text) > MAX_YAML:
        raise TooMuch(f"its YAML has {_amount(len(text))}, more than {_amount(MAX_YAML)}")
    depth = 0
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        if isinstance(event, yaml.AliasEvent):
            raise TooMuch(f"its YAML has an alias in line {event.start_mark.line + 1}, which no recorder writes")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > MAX_YAML_DEPTH:
            raise TooMuch(f"its YAML is nested deeper than {MAX_YAML_DEPTH}")


class _PlainYaml(YAML):  # type: ignore[misc]
    """The library's YAML without aliases."""

    def load(self, stream: Any) -> Any:
        check_yaml(str(stream))
        return super().load(stream)


@dataclass(frozen=True)
class _Chunk:
    """A chunk's place in its file, what it declares, and the beginning of its compressed content."""

    offset: int
    size: int
    compression: str
    content_start: int
    content_end: int
    head: bytes


def _chunks(file: BinaryIO, end: int) -> Iterator[_Chunk]:
    """Yield the chunks of an MCAP file that ends at byte `end`, up to a tear."""
    if file.read(len(_MCAP_MAGIC)) != _MCAP_MAGIC:
        return
    while len(head := file.read(9)) == 9 and head[0] not in (0, _FOOTER):
        start = file.tell()
        stop = min(start + int.from_bytes(head[1:], "little"), end)
        if head[0] == _CHUNK:
            fields = file.read(32)  # first and last time, size, checksum, length of the compression's name
            if len(fields) < 32:
                return
            (size,) = struct.unpack_from("<Q", fields, 16)
            (length,) = struct.unpack_from("<I", fields, 28)
            compression = file.read(min(length, _LONGEST_NAME)).decode(errors="replace")
            content = start + 40 + length
            file.seek(content)
            yield _Chunk(start - 9, size, compression, content, stop, file.read(_FRAME_HEADER))
        file.seek(stop)


def _held_size(file: BinaryIO, chunk: _Chunk) -> int:
    """Return how much a chunk holds: as its frame's header says, else counted, to a little more than it declares.

    The decompressor holds a frame to its header.
    """
    if chunk.compression == "zstd":
        try:
            size = zstd.get_frame_info(chunk.head).decompressed_size
        except zstd.ZstdError:
            return 0  # it will not be decompressed either
        return size if size is not None else _counted(zstd.ZstdDecompressor(), file, chunk)
    length = chunk.content_end - chunk.content_start
    if chunk.compression == "lz4" and length * _LZ4_FACTOR > MAX_CHUNK:
        return _counted(LZ4FrameDecompressor(), file, chunk)
    return 0  # it cannot be more than the cap


def _counted(decompressor: Any, file: BinaryIO, chunk: _Chunk) -> int:
    file.seek(chunk.content_start)
    data, count = file.read(max(0, chunk.content_end - chunk.content_start)), 0
    try:
        while count <= chunk.size and not decompressor.eof:
            output = decompressor.decompress(data, max_length=_OUTPUT_STEP)
            count, data = count + len(output), b""
            if not output and decompressor.needs_input:
                break
    except (zstd.ZstdError, RuntimeError):  # torn or garbled: what comes before counts
        pass
    return count


class _BoundedFile(zstd.ZstdFile):
    """A compressed storage file on its way to the temporary folder, which it may fill by half."""

    def __init__(self, file: Any, _mode: str) -> None:
        super().__init__(file)
        self._left = shutil.disk_usage(tempfile.gettempdir()).free // 2

    def read(self, size: int | None = -1) -> bytes:
        data: bytes = super().read(_OUTPUT_STEP if size is None or size < 0 else size)
        self._left -= len(data)
        if self._left < 0:
            raise TooMuch(f"its files need more than half of the free space in '{tempfile.gettempdir()}'")
        return data


def _zstd_chunk(data: bytes, size: int) -> bytes:
    _check_chunk_size(size, "a chunk")
    return bytes(zstd.ZstdDecompressor().decompress(data, max_length=size + 1))


def _lz4_chunk(data: bytes, size: int) -> bytes:
    _check_chunk_size(size, "a chunk")
    return bytes(LZ4FrameDecompressor().decompress(data, max_length=size + 1))


def _zstd_message(data: bytes) -> bytes:
    message = zstd.ZstdDecompressor().decompress(data, max_length=MAX_MESSAGE + 1)
    if len(message) > MAX_MESSAGE:
        raise TooMuch(f"a message holds more than {_amount(MAX_MESSAGE)}")
    return bytes(message)


def _check_chunk_size(size: int, place: str) -> None:
    if size > MAX_CHUNK:
        raise TooMuch(f"{place} declares {_amount(size)}, more than {_amount(MAX_CHUNK)}")


def _amount(size: int) -> str:
    return f"{size / MEBIBYTE:.0f} MiB" if size >= MEBIBYTE else f"{size} bytes"
