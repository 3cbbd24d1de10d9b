"""The parallel hand as boxes, and what it holds, sampled as points for checks against the cloud.

Everything is in the tcp frame: z forward (out of the hand), y the direction in which the fingers close.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from panda_executor.limits import FloatArray

MAX_OPENING = 0.08  # between the fingers [m]
FINGERTIP_BELOW_TCP = 0.0095  # the rubber tips reach this far past the tcp [m]
PALM_ABOVE_TCP = 0.0375  # the hand's underside, seen from the tcp [m]
FINGER_HALF_WIDTH = 0.0105  # along tcp x [m]
FINGER_THICKNESS = 0.0152  # along tcp y [m]

_HAND_LENGTH = 0.1034  # origin of the hand to the tcp [m]
_FLANGE_TOP = 0.13  # the hand and link 7 above the tcp, as far as objects on the table may reach [m]
# Distances of the sampled points. With the hand nearly upright a box enters a column underside first, so that
# is sampled finer than the cells of the obstacle grid, 5 mm; the sides matter when the hand leans.
_UNDERSIDE_SPACING = 0.0045
_SIDE_SPACING = 0.016


@dataclass(frozen=True)
class Box:
    """Axis-aligned in the tcp frame: lower and upper corner [m]."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def grown(self, margin: float) -> Box:
        """The same box, larger by `margin` [m] on each side."""
        return Box(
            (self.lower[0] - margin, self.lower[1] - margin, self.lower[2] - margin),
            (self.upper[0] + margin, self.upper[1] + margin, self.upper[2] + margin),
        )

    def surface(self) -> FloatArray:
        """Points on the face that looks out of the hand (+z) and, coarser, on the four sides: (N, 3)."""
        x, y = (self._steps(axis, _UNDERSIDE_SPACING) for axis in (0, 1))
        face = np.stack(np.meshgrid(x, y, [self.upper[2]], indexing="ij"), axis=-1).reshape(-1, 3)
        x, y, z = (self._steps(axis, _SIDE_SPACING) for axis in range(3))
        across = np.stack(np.meshgrid(x, y[[0, -1]], z, indexing="ij"), axis=-1).reshape(-1, 3)
        along = np.stack(np.meshgrid(x[[0, -1]], y, z, indexing="ij"), axis=-1).reshape(-1, 3)
        return np.concatenate([face, across, along])

    def _steps(self, axis: int, spacing: float) -> FloatArray:
        low, high = self.lower[axis], self.upper[axis]
        return np.linspace(low, high, max(2, int(np.ceil((high - low) / spacing)) + 1))


@dataclass(frozen=True)
class HeldObject:
    """A box around what the fingers hold, in the tcp frame [m]."""

    half_x: float
    half_y: float
    below: float  # from the tcp down to its underside
    above: float  # from the tcp up to its top

    def box(self) -> Box:
        """As a box; its top is cut at the palm, which the hand's own box covers."""
        above = min(self.above, PALM_ABOVE_TCP)
        return Box((-self.half_x, -self.half_y, -above), (self.half_x, self.half_y, self.below))


@dataclass(frozen=True)
class HandShape:
    """The hand with its fingers `width` [m] apart, with or without an object, grown by `margin` [m]."""

    width: float = MAX_OPENING
    held: HeldObject | None = None
    margin: float = 0.0
    points: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        parts = [box.grown(self.margin).surface() for box in self.boxes()]
        points = np.unique(np.round(np.concatenate(parts), 5), axis=0)
        points.flags.writeable = False
        object.__setattr__(self, "points", points)

    def boxes(self) -> list[Box]:
        """Palm with flange, finger mounts, fingers, and the held object."""
        inner = self.width / 2.0
        outer = inner + FINGER_THICKNESS
        boxes = [
            Box((-0.032, -0.103, -_HAND_LENGTH - 0.03), (0.032, 0.103, -PALM_ABOVE_TCP)),
            Box((-0.045, -0.045, -_HAND_LENGTH - _FLANGE_TOP), (0.045, 0.045, -_HAND_LENGTH)),
        ]
        for sign in (-1.0, 1.0):
            finger = sorted((sign * inner, sign * outer))
            mount = sorted((sign * inner, sign * (inner + 0.026)))
            x = FINGER_HALF_WIDTH
            boxes.append(Box((-x, finger[0], -PALM_ABOVE_TCP), (x, finger[1], FINGERTIP_BELOW_TCP)))
            boxes.append(Box((-x, mount[0], -PALM_ABOVE_TCP), (x, mount[1], -PALM_ABOVE_TCP + 0.014)))
        if self.held is not None:
            boxes.append(self.held.box())
        return boxes
