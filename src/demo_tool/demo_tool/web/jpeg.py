"""Pictures as small as the link needs them."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock

import cv2
import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Level:
    """Width in pixels that a picture is reduced to where it is wider, and JPEG quality."""

    width: int
    quality: int


LEVELS = (Level(320, 35), Level(480, 45), Level(640, 55), Level(960, 65), Level(1280, 80))
START_LEVEL = 3
_TOO_LONG_MS = 180.0
_SHORT_MS = 40.0


def next_level(level: int, transfer_ms: float) -> int:
    """The index into LEVELS for the next picture, from the last one's and how long it took to arrive [ms].

    One step at a time; between the two limits nothing changes, so that the picture does not swing.
    """
    level = min(max(level, 0), len(LEVELS) - 1)
    if transfer_ms > _TOO_LONG_MS:
        return max(level - 1, 0)
    if transfer_ms < _SHORT_MS:
        return min(level + 1, len(LEVELS) - 1)
    return level


def encode(picture: npt.NDArray[np.uint8], level: Level, max_width: int) -> bytes:
    """The JPEG file of (H, W, 3) RGB, reduced to the level's or the page's width, whichever is smaller."""
    height, width = picture.shape[:2]
    target = min(width, level.width, max_width)
    if target < width:
        size = (target, max(1, round(height * target / width)))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
    bgr = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, level.quality])
    return data.tobytes()


class JpegCache:
    """The last few pictures as they were sent, so that several pages cost one encoding; thread-safe."""

    def __init__(self, size: int = 6) -> None:
        self._files: OrderedDict[tuple[str, int, Level, int], bytes] = OrderedDict()
        self._size = size
        self._lock = Lock()

    def file(self, name: str, sequence: int, picture: npt.NDArray[np.uint8], level: Level, max_width: int) -> bytes:
        """`encode`d, or taken from the last few; `name` and `sequence` say which picture it is."""
        key = (name, sequence, level, max_width)
        with self._lock:
            if key not in self._files:
                self._files[key] = encode(picture, level, max_width)
                while len(self._files) > self._size:
                    self._files.popitem(last=False)
            return self._files[key]
