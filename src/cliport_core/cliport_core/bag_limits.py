"""Caps on what a bag from elsewhere may declare, checked before anything is decompressed.

18 kB of compressed zeros can declare gigabytes, and some hundred bytes of YAML aliases expand to hundreds of megabytes.
What decompresses (backports.zstd, lz4) and PyYAML are imported when they are needed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from cliport_core.errors import CoreError

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


class TooMuchError(CoreError):
    """A bag that declares, or holds, more than it may."""


def check_file(path: Path) -> None:
    """Refuse an MCAP file whose chunks declare too much, or hold another amount than they declare."""
    with path.open("rb") as file:
        for chunk in _chunks(file, path.stat().st_size):
            place = f"the chunk at byte {chunk.offset}"
            _check_chunk_size(chunk.size, place)
            next_record = file.tell()
            if _held_size(file, chunk) > chunk.size:
                raise TooMuchError(f"{place} declares {_amount(chunk.size)} and holds more")
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
            raise TooMuchError(f"chunks that overlap in time declare more than {_amount(MAX_TOGETHER)}")


def check_yaml(text: str) -> None:
    """Refuse YAML that is long, deep, or has aliases: recorders write none."""
    import yaml

    _check_yaml_size(len(text))
    depth = 0
    for event in yaml.parse(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
        if isinstance(event, yaml.AliasEvent):
            raise TooMuchError(f"its YAML has an alias in line {event.start_mark.line + 1}, which no recorder writes")
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > MAX_YAML_DEPTH:
            raise TooMuchError(f"its YAML is nested deeper than {MAX_YAML_DEPTH}")


def load_yaml(path: Path) -> Any:
    """Return the content of a YAML file that keeps to the caps.

    Raises:
        TooMuchError: when it does not. OSError, UnicodeDecodeError, yaml.YAMLError.
    """
    import yaml

    _check_yaml_size(path.stat().st_size)
    text = path.read_text(encoding="utf-8")
    check_yaml(text)
    return yaml.load(text, getattr(yaml, "CSafeLoader", yaml.SafeLoader))  # the C one is ten times as fast


def decompress_zstd(data: bytes, size: int) -> bytes:
    """Return the records of a chunk, which may be torn; at most a byte more than it declares."""
    from backports import zstd

    _check_chunk_size(size, "a chunk")
    return bytes(zstd.ZstdDecompressor().decompress(data, max_length=size + 1))


def decompress_lz4(data: bytes, size: int) -> bytes:
    """Return the records of a chunk, which may be torn; at most a byte more than it declares."""
    from lz4.frame import LZ4FrameDecompressor

    _check_chunk_size(size, "a chunk")
    return bytes(LZ4FrameDecompressor().decompress(data, max_length=size + 1))


def decompress_message(data: bytes) -> bytes:
    """Return a message that was compressed by itself. Raises TooMuchError."""
    from backports import zstd

    message = zstd.ZstdDecompressor().decompress(data, max_length=MAX_MESSAGE + 1)
    if len(message) > MAX_MESSAGE:
        raise TooMuchError(f"a message holds more than {_amount(MAX_MESSAGE)}")
    return bytes(message)


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
        from backports import zstd

        try:
            size = zstd.get_frame_info(chunk.head).decompressed_size
        except zstd.ZstdError:
            return 0  # it will not be decompressed either
        return size if size is not None else _counted(zstd.ZstdDecompressor(), file, chunk)
    length = chunk.content_end - chunk.content_start
    if chunk.compression == "lz4" and length * _LZ4_FACTOR > MAX_CHUNK:
        from lz4.frame import LZ4FrameDecompressor

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
    except Exception:  # torn or garbled: what comes before counts
        pass
    return count


def _check_chunk_size(size: int, place: str) -> None:
    if size > MAX_CHUNK:
        raise TooMuchError(f"{place} declares {_amount(size)}, more than {_amount(MAX_CHUNK)}")


def _check_yaml_size(size: int) -> None:
    if size > MAX_YAML:
        raise TooMuchError(f"its YAML has {_amount(size)}, more than {_amount(MAX_YAML)}")


def _amount(size: int) -> str:
    return f"{size / MEBIBYTE:.0f} MiB" if size >= MEBIBYTE else f"{size} bytes"
