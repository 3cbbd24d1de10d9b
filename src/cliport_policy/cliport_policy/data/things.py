"""What lies on the table, told from it by its height."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cliport_perception.heightmap import Heightmap

_RAISED = 0.005  # m above the base's z = 0: a thing, neither the table nor a shadow on it
_LEAST = 60  # raised pixels of a thing: less is noise
_MARGIN = 3  # pixels around a thing that go with it
_HIDDEN = 12  # pixels from a thing: so far off it hides the table from the camera


class Thing(NamedTuple):
    """Something on the table. mask: its pixels and what it hides, (H, W); loose: wholly in the picture."""

    mask: NDArray[np.bool_]
    loose: bool


def raised(scene: Heightmap) -> NDArray[np.bool_]:
    """Where something rises above the table: (H, W)."""
    return scene.valid & (scene.height > _RAISED)


def find_things(scene: Heightmap) -> list[Thing]:
    """What rises above the table, each with its holes and with what it hides from the camera; large ones first."""
    high = raised(scene)
    near = cv2.dilate(high.astype(np.uint8), _square(_HIDDEN)).astype(bool)
    stuff = cv2.morphologyEx((high | (near & ~scene.valid)).astype(np.uint8), cv2.MORPH_CLOSE, _square(1))
    contours, _ = cv2.findContours(stuff, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    things = []
    for contour in sorted(contours, key=cv2.contourArea, reverse=True):
        outline = cv2.drawContours(np.zeros_like(stuff), [contour], 0, 1, -1)
        seen = high & outline.astype(bool)
        if seen.sum() >= _LEAST:
            mask = cv2.dilate(outline, _square(_MARGIN)).astype(bool)
            things.append(Thing(mask, not (seen[[0, -1]].any() or seen[:, [0, -1]].any())))
    return things


def _square(half: int) -> NDArray[np.uint8]:
    return np.ones((2 * half + 1, 2 * half + 1), np.uint8)
