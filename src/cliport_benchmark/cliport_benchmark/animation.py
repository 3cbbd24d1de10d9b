"""An animated GIF of what a camera saw: small, and with the colours of small things."""

from __future__ import annotations

import math
import time
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

SIZE = (480, 270)
EVERY = 0.4  # time between two frames that are kept, at first [s]
SPEED_UP = 2.0
_MOST = 300  # frames that are held; then every other one goes, and half as many come
_COLORS = 128
_GRAIN = 20  # a pixel that changed by fewer grey levels shows the camera's noise, not a motion
_SPREAD = np.ones((7, 7), np.uint8)  # what a motion touches, about each pixel that it changed


class Animation:
    """Keeps small camera frames at an interval that grows with their number.

    What nothing moved through keeps its pixels from frame to frame: the camera's noise would fill the file.
    """

    def __init__(self) -> None:
        self._frames: list[NDArray[np.uint8]] = []
        self._last, self._every = -math.inf, EVERY

    def take(self, frame: NDArray[np.uint8]) -> None:
        """Keep a frame, RGB (h, w, 3), if the interval has passed since the last one."""
        now = time.monotonic()
        if now - self._last < self._every:
            return
        self._last = now
        small = np.asarray(cv2.resize(cv2.medianBlur(frame, 3), SIZE, interpolation=cv2.INTER_AREA), np.uint8)
        self._frames.append(_with_still_pixels(small, self._frames[-1]) if self._frames else small)
        if len(self._frames) > _MOST:
            self._frames, self._every = self._frames[::2], 2 * self._every

    def save(self, path: Path) -> None:
        """Write the GIF; no file when there are no frames."""
        if self._frames:
            palette = _palette(self._frames)
            first, *others = (
                Image.fromarray(f).quantize(palette=palette, dither=Image.Dither.NONE) for f in self._frames
            )
            pause = round(1000 * self._every / SPEED_UP)
            first.save(path, save_all=True, append_images=others, loop=0, duration=pause, optimize=True)


def _with_still_pixels(frame: NDArray[np.uint8], before: NDArray[np.uint8]) -> NDArray[np.uint8]:
    changed = (cv2.absdiff(frame, before).max(axis=2) > _GRAIN).astype(np.uint8)
    return np.where(cv2.dilate(changed, _SPREAD)[..., None] > 0, frame, before)


def _palette(frames: list[NDArray[np.uint8]]) -> Image.Image:
    """One palette for all frames, of colours that occur, however rarely: by area the table alone would fill it."""
    seen = np.unique(np.concatenate([np.unique(f.reshape(-1, 3) & 0xF8, axis=0) for f in frames]), axis=0) + 4
    return Image.fromarray(seen[None]).quantize(_COLORS)
