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
MOUNT_THICKNESS = 0.026  # of a finger's upper end, along tcp y [m]
MOUNT_ABOVE_TCP = PALM_ABOVE_TCP - 0.014  # its underside [m]
HAND_HALF_LENGTH = 0.103  # of the hand above the fingers, along tcp y [m]
HAND_HALF_WIDTH = 0.032  # along tcp x [m]

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


@dataclass(frozen=True, eq=False)
class HeldObject:
    """What the fingers hold: the cells (N, 2) that it covers [m, tcp x and y], and its extent along tcp z.

    Cells, not a box around them: a ring is lowered over a peg.
    """

    cells: FloatArray
    below: float  # from the tcp down to its underside [m]
    above: float  # from the tcp up to its top [m]

    def surface(self, margin: float = 0.0) -> FloatArray:
        """Points (M, 3) on its underside and, coarser, higher up to the palm; larger by `margin` [m] all round."""
        turns = np.arange(8) * (np.pi / 4.0)
        offsets = margin * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        cells = self.cells if margin == 0.0 else (self.cells[:, None] + offsets).reshape(-1, 2)
        underside = _thinned(cells, _UNDERSIDE_SPACING)
        layers = [np.column_stack([underside, np.full(len(underside), self.below + margin)])]
        coarse = _thinned(cells, _SIDE_SPACING)
        top = -min(self.above + margin, PALM_ABOVE_TCP)
        for z in np.linspace(top, self.below, max(2, int(np.ceil((self.below - top) / _SIDE_SPACING)) + 1))[:-1]:
            layers.append(np.column_stack([coarse, np.full(len(coarse), z)]))
        return np.concatenate(layers)


def _thinned(points: FloatArray, spacing: float) -> FloatArray:
    """One of the points (N, 2) in each square of edge `spacing` [m]."""
    _, first = np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)
    return points[first]


@dataclass(frozen=True)
class HandShape:
    """The hand with its fingers `width` [m] apart, with or without an object, grown by `margin` [m]."""

    width: float = MAX_OPENING
    held: HeldObject | None = None
    margin: float = 0.0
    points: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        parts = [box.grown(self.margin).surface() for box in self.boxes()]
        if self.held is not None:
            parts.append(self.held.surface(self.margin))
        points = np.unique(np.round(np.concatenate(parts), 5), axis=0)
        points.flags.writeable = False
        object.__setattr__(self, "points", points)

    def boxes(self) -> list[Box]:
        """Palm with flange, finger mounts and fingers."""
        inner = self.width / 2.0
        outer = inner + FINGER_THICKNESS
        boxes = [
            Box(
                (-HAND_HALF_WIDTH, -HAND_HALF_LENGTH, -_HAND_LENGTH - 0.03),
                (HAND_HALF_WIDTH, HAND_HALF_LENGTH, -PALM_ABOVE_TCP),
            ),
            Box((-0.045, -0.045, -_HAND_LENGTH - _FLANGE_TOP), (0.045, 0.045, -_HAND_LENGTH)),
        ]
        for sign in (-1.0, 1.0):
            finger = sorted((sign * inner, sign * outer))
            mount = sorted((sign * inner, sign * (inner + MOUNT_THICKNESS)))
            x = FINGER_HALF_WIDTH
            boxes.append(Box((-x, finger[0], -PALM_ABOVE_TCP), (x, finger[1], FINGERTIP_BELOW_TCP)))
            boxes.append(Box((-x, mount[0], -PALM_ABOVE_TCP), (x, mount[1], -MOUNT_ABOVE_TCP)))
        return boxes
