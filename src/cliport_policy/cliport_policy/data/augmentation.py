"""Random SE(2) transforms of an observation and its labels, and small errors of what is measured.

See docs/paper.md, "Augmentation".
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

MAX_TRIES = 100
_HEIGHT_ERROR = 0.002  # m, spread of the table's height through calibration errors
_DIRECTION = re.compile(r"\b(left|right|top|bottom|front|back|near|far)\b")
# Of several equal holes the middle one is what lies at no side; that of a stand or of three tiles turns with them.
_MIDDLE_HOLE = re.compile(r"\bmiddle\b.*\bhole\b")
_OWN_FRAME = re.compile(r"^(?=.*\brope\b).*\b(tip|corner)\b")  # of the rope's square: its front and left turn with it


class PlanarTransform(NamedTuple):
    """Rigid motion of a picture.

    angle: rad, from columns towards rows: a yaw about +z. matrix: (2, 3), acts on (col, row) pixels.
    """

    angle: float
    matrix: NDArray[np.float64]

    @property
    def is_identity(self) -> bool:
        """True if the transform moves nothing."""
        return bool((self.matrix == np.eye(2, 3)).all())

    def pixel(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return the moved position of a pixel (row, col)."""
        col, row = self.matrix @ (pixel[1], pixel[0], 1.0)
        return float(row), float(col)


def identity_transform() -> PlanarTransform:
    """Return the transform that moves nothing."""
    return PlanarTransform(0.0, np.eye(2, 3))


def draw_transform(
    shape: tuple[int, int],
    keep: list[tuple[int, int]],
    rotation_sigma_deg: float,
    translation_sigma_px: float,
    rng: np.random.Generator,
) -> PlanarTransform:
    """Draw a transform about the image's centre that keeps all given (row, col) pixels inside shape (rows, cols).

    Rotation and translation are normal; drawn again while a pixel leaves, at most 100 times, then the identity.
    """
    rows, cols = shape
    center = np.array([(cols - 1) / 2, (rows - 1) / 2])
    for _ in range(MAX_TRIES):
        angle = math.radians(rng.normal(0, rotation_sigma_deg))
        cos, sin = math.cos(angle), math.sin(angle)
        turn = np.array([[cos, -sin], [sin, cos]])
        shift = center - turn @ center + rng.normal(0, translation_sigma_px, 2)
        transform = PlanarTransform(angle, np.column_stack((turn, shift)))
        moved = [transform.pixel(pixel) for pixel in keep]
        if all(0 <= row <= rows - 1 and 0 <= col <= cols - 1 for row, col in moved):
            return transform
    return identity_transform()


def warp(channels: NDArray[np.float32], transform: PlanarTransform) -> NDArray[np.float32]:
    """Move channels (H, W, C) by a transform, bilinear; what enters from outside is zero."""
    size = (channels.shape[1], channels.shape[0])
    out: NDArray[np.float32] = cv2.warpAffine(channels, transform.matrix, size, flags=cv2.INTER_LINEAR)
    return out


def names_direction(instruction: str) -> bool:
    """Return True if a sentence says where something is, so that it may not be put elsewhere."""
    text = instruction.lower()
    return _DIRECTION.search(text) is not None or _MIDDLE_HOLE.search(text) is not None


def is_falsified_by_turning(instruction: str) -> bool:
    """Return True if a sentence names a side of the scene, not one of a thing that has a front of its own."""
    return names_direction(instruction) and not names_own_frame(instruction)


def names_own_frame(instruction: str) -> bool:
    """Return True if a sentence names sides of a thing that has a front of its own, wherever it looks to."""
    return _OWN_FRAME.search(instruction.lower()) is not None


def jitter_color(color: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Apply a small random gain to channels and brightness, as an exposure or white-balance error does."""
    gain = rng.normal(1.0, 0.04) * rng.normal(1.0, 0.02, 3)
    offset = rng.normal(0.0, 5.0)
    table = np.clip(np.arange(256)[:, None] * gain + offset, 0, 255).astype(np.uint8)  # (256, 3)
    out: NDArray[np.uint8] = cv2.LUT(color, table[None])
    return out


def jitter_height(height: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Shift all heights [m] up or down by the same 2 mm or so."""
    return height + np.float32(rng.normal(0.0, _HEIGHT_ERROR))
