"""Things on the table, told from it by their height."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap

_MIN_HEIGHT = 0.005  # m above the base's z = 0: higher than the table and the noise in shadows on it
_MIN_PIXELS = 60  # raised pixels of a thing; fewer are noise
_MARGIN = 3  # pixels around a thing that go with it
_SHADOW = 12  # pixels around a thing on which it may hide the table from the camera


class Thing(NamedTuple):
    """Thing on the table.

    mask: (H, W), its pixels and those it hides. movable: True if it lies wholly in the picture.
    """

    mask: NDArray[np.bool_]
    movable: bool


def raised(scene: Heightmap) -> NDArray[np.bool_]:
    """Return a mask (H, W) of the pixels above the table."""
    return scene.valid & (scene.height > _MIN_HEIGHT)


def find_things(scene: Heightmap) -> list[Thing]:
    """Return the things on the table, each with its holes and with what it hides from the camera; large ones first."""
    high = raised(scene)
    near = cv2.dilate(high.astype(np.uint8), _square(_SHADOW)).astype(bool)
    stuff = cv2.morphologyEx((high | (near & ~scene.valid)).astype(np.uint8), cv2.MORPH_CLOSE, _square(1))
    contours, _ = cv2.findContours(stuff, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    things = []
    for contour in sorted(contours, key=cv2.contourArea, reverse=True):
        outline = cv2.drawContours(np.zeros_like(stuff), [contour], 0, 1, -1)
        seen = high & outline.astype(bool)
        if seen.sum() >= _MIN_PIXELS:
            mask = cv2.dilate(outline, _square(_MARGIN)).astype(bool)
            things.append(Thing(mask, not (seen[[0, -1]].any() or seen[:, [0, -1]].any())))
    return things


def _square(half: int) -> NDArray[np.uint8]:
    return np.ones((2 * half + 1, 2 * half + 1), np.uint8)
