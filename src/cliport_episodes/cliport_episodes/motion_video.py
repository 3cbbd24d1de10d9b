"""Video of a step's motion, beside the step's file: MJPEG in AVI, which players open. Nothing depends on it."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from cliport_episodes.disk import disk_errors, replace_bytes
from cliport_episodes.errors import EpisodeError

MOST_BYTES = 16_000_000  # of a video that is read
_HAS_INDEX = _KEY_FRAME = 0x10  # flags of AVI
_FRAME = b"00dc"  # name of a compressed picture of stream 0
_CODEC = b"MJPG"
_BIT_DEPTH = 24
_PERIOD_AT = 32  # where a file that `_avi` made says the time between two frames


class MotionVideo(NamedTuple):
    """Frames of a motion: JPEG files of width x height pixels, taken every `period` seconds."""

    frames: tuple[bytes, ...]
    period: float
    width: int
    height: int


def video_path(episode: Path, stamp_ns: int) -> Path:
    """Return the path of a step's video; stamp_ns: of the picture on which it was chosen, as numbers may change."""
    return episode / f"motion_{stamp_ns}.avi"


def write_video(path: Path, video: MotionVideo) -> None:
    """Write a video, as a whole or not at all. Raises DiskError."""
    with disk_errors(path):
        replace_bytes(path, _avi(video))


def read_frames(path: Path) -> tuple[tuple[bytes, ...], float]:
    """Return a video's frames, which are JPEG files, and the time between two of them [s]; none where there is no file.

    Raises:
        EpisodeError: when it is larger than MOST_BYTES, or no such video, or torn.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise EpisodeError(f"'{path.name}' is not read: it is larger than {MOST_BYTES / 1e6:.0f} MB")
        file = path.read_bytes()
    except FileNotFoundError:
        return (), 0.0
    except OSError as error:
        raise EpisodeError(f"'{path.name}' cannot be read: {error.strerror}") from None
    try:
        (microseconds,) = struct.unpack_from("<I", file, _PERIOD_AT)
        (movie,) = (content for name, content in _chunks(file[12:]) if name == b"LIST" and content[:4] == b"movi")
        return tuple(content for name, content in _chunks(movie[4:]) if name == _FRAME), microseconds / 1e6
    except (ValueError, struct.error):
        raise EpisodeError(f"'{path.name}' is no video of a motion, or it is torn") from None


def _avi(video: MotionVideo) -> bytes:
    """Return the file (Microsoft, AVI RIFF File Reference)."""
    count, period_us = len(video.frames), round(video.period * 1e6)
    size, largest = (video.width, video.height), max(map(len, video.frames))
    main = struct.pack("<14I", period_us, 0, 0, _HAS_INDEX, count, 0, 1, largest, *size, 0, 0, 0, 0)
    stream = struct.pack(
        "<4s4sIHH8I4H", b"vids", _CODEC, 0, 0, 0, 0, period_us, 10**6, 0, count, largest, 0, 0, 0, 0, *size
    )
    picture = struct.pack("<IiiHH4sIiiII", 40, *size, 1, _BIT_DEPTH, _CODEC, 3 * size[0] * size[1], 0, 0, 0, 0)
    header = _list(b"hdrl", _chunk(b"avih", main) + _list(b"strl", _chunk(b"strh", stream) + _chunk(b"strf", picture)))
    frames = [_chunk(_FRAME, frame) for frame in video.frames]
    index, offset = [], len(b"movi")
    for frame, chunk in zip(video.frames, frames, strict=True):
        index.append(struct.pack("<4sIII", _FRAME, _KEY_FRAME, offset, len(frame)))
        offset += len(chunk)
    movie = _list(b"movi", b"".join(frames))
    return _chunk(b"RIFF", b"AVI " + header + movie + _chunk(b"idx1", b"".join(index)))


def _list(name: bytes, content: bytes) -> bytes:
    return _chunk(b"LIST", name + content)


def _chunk(name: bytes, content: bytes) -> bytes:
    return name + struct.pack("<I", len(content)) + content + bytes(len(content) % 2)


def _chunks(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield the name and the content of each chunk. Raises ValueError, struct.error where it is torn."""
    place = 0
    while place < len(content):
        name, size = struct.unpack_from("<4sI", content, place)
        place += 8
        if place + size > len(content):
            raise ValueError
        yield name, content[place : place + size]
        place += size + size % 2
