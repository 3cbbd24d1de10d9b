"""Scenes as a mirror shows them: what was left is right, and the sentence says so.

So a few demonstrations do not teach where "left" lay in them. The camera sees both sides of the table alike.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_policy.data.augmentation import names_own_frame
from cliport_policy.data.demonstrations import Demonstration

Scalar = TypeVar("Scalar", bound=np.generic)

_ROW_WORDS = {"left": "right"}
_COLUMN_WORDS = {"top": "bottom", "front": "back", "near": "far"}


class Mirror(NamedTuple):
    """Axes along which a scene is mirrored: its rows (+y), its columns (+x), or both, which is half a turn."""

    rows: bool
    columns: bool

    def sentence(self, instruction: str) -> str:
        """Return a sentence with the words for the sides exchanged.

        Those of a thing that has a front of its own: left and right, in one mirror; not in two, which are half a turn,
        nor where it names both, since what goes from left to right also goes from right to left.
        """
        if names_own_frame(instruction):
            both = all(re.search(rf"\b{side}\b", instruction) for side in ("left", "right"))
            words = _ROW_WORDS if self.rows != self.columns and not both else {}
        else:
            words = (_ROW_WORDS if self.rows else {}) | (_COLUMN_WORDS if self.columns else {})
        words = words | {there: here for here, there in words.items()}
        return re.sub(r"\b[a-z]+\b", lambda word: words.get(word[0], word[0]), instruction)

    def scene(self, scene: Heightmap) -> Heightmap:
        """Return what the mirror shows of a scene."""
        return dataclasses.replace(
            scene, color=self._image(scene.color), height=self._image(scene.height), valid=self._image(scene.valid)
        )

    def demonstration(self, demo: Demonstration, shape: tuple[int, int]) -> Demonstration:
        """Return a demonstration in a scene of `shape` (rows, columns) as the mirror shows it."""
        if demo.acts:
            demo = dataclasses.replace(
                demo,
                pick_pixel=self._pixel(demo.pick_pixel, shape),
                pick_yaw=self._yaw(demo.pick_yaw),
                place_pixel=self._pixel(demo.place_pixel, shape),
                place_yaw=self._yaw(demo.place_yaw),
            )
        return dataclasses.replace(demo, instruction=self.sentence(demo.instruction))

    def _image(self, image: NDArray[Scalar]) -> NDArray[Scalar]:
        return image[:: -1 if self.rows else 1, :: -1 if self.columns else 1].copy()

    def _pixel(self, pixel: tuple[int, int], shape: tuple[int, int]) -> tuple[int, int]:
        row, col = pixel
        return shape[0] - 1 - row if self.rows else row, shape[1] - 1 - col if self.columns else col

    def _yaw(self, yaw: float) -> float:
        yaw = -yaw if self.rows else yaw
        return math.pi - yaw if self.columns else yaw


MIRRORS = (Mirror(True, False), Mirror(False, True), Mirror(True, True))


def draw_mirror(rng: np.random.Generator) -> Mirror:
    """Draw a mirror, or two."""
    return MIRRORS[int(rng.integers(len(MIRRORS)))]


def mirrored_sentences(instruction: str) -> set[str]:
    """Return what a sentence may become in a mirror."""
    return {mirror.sentence(instruction) for mirror in MIRRORS}
