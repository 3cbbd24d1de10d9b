"""JPEG encoding in a quality that follows the speed of the link."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.image_files import encode_jpeg


@dataclass(frozen=True)
class Level:
    """A picture quality: the greatest width [pixels], and the JPEG quality."""

    width: int
    quality: int


LEVELS = (Level(320, 35), Level(480, 45), Level(640, 55), Level(960, 65), Level(1280, 80))
START_LEVEL = 3
_LOWER_ABOVE_MS = 180.0  # transfer time after which the level is lowered
_RAISE_BELOW_MS = 40.0  # transfer time after which it is raised


def next_level(level: int, transfer_ms: float) -> int:
    """Return the index into LEVELS for the next picture, from the last one's and its transfer time [ms].

    It changes by one step at a time; between the two limits it stays, so that the quality does not swing.
    """
    level = min(max(level, 0), len(LEVELS) - 1)
    if transfer_ms > _LOWER_ABOVE_MS:
        return max(level - 1, 0)
    if transfer_ms < _RAISE_BELOW_MS:
        return min(level + 1, len(LEVELS) - 1)
    return level


def encode(picture: npt.NDArray[np.uint8], level: Level, max_width: int) -> bytes:
    """Encode (H, W, 3) RGB as a JPEG file, reduced to the level's or the page's width, whichever is smaller."""
    height, width = picture.shape[:2]
    target = min(width, level.width, max_width)
    if target < width:
        size = (target, max(1, round(height * target / width)))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    return encode_jpeg(picture, level.quality)


class JpegCache:
    """Cache of the last few encoded pictures, so that several pages cost one encoding; thread-safe."""

    def __init__(self, size: int = 6) -> None:
        self._files: OrderedDict[tuple[str, int, Level, int], bytes] = OrderedDict()
        self._size = size
        self._lock = Lock()

    def file(self, name: str, sequence: int, picture: npt.NDArray[np.uint8], level: Level, max_width: int) -> bytes:
        """Return a picture as `encode` does, or from the cache; `name` and `sequence` identify it."""
        key = (name, sequence, level, max_width)
        with self._lock:
            if key not in self._files:
                self._files[key] = encode(picture, level, max_width)
                while len(self._files) > self._size:
                    self._files.popitem(last=False)
            return self._files[key]
