"""The parallel hand as boxes, and what it holds, sampled as points for checks against the cloud.

Everything is in the tcp frame: z forward (out of the hand), y the direction in which the fingers close.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from panda_model import FloatArray, HandModel

# Distances of the sampled points. With the hand nearly upright a box enters a column underside first, so that
# is sampled finer than the cells of the obstacle grid, 5 mm; the sides matter when the hand leans.
_UNDERSIDE_SPACING = 0.0045
_SIDE_SPACING = 0.016
_HALF = 2**19  # more than any coordinate of the hand in hundredths of a millimetre
_ROUNDING = 1e-9  # by which a ball that must hold points is larger than they need [m]


@dataclass(frozen=True)
class Box:
    """A box along the axes of the tcp frame: lower and upper corner [m]."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]

    def grown(self, margin: float) -> Box:
        """Return the same box, larger by `margin` [m] on each side."""
        return Box(
            (self.lower[0] - margin, self.lower[1] - margin, self.lower[2] - margin),
            (self.upper[0] + margin, self.upper[1] + margin, self.upper[2] + margin),
        )

    def surface(self) -> FloatArray:
        """Return points (N, 3) on the face that looks out of the hand (+z) and, coarser, on the four sides."""
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
    """The object in the fingers: the cells (N, 2) that it covers [m, tcp x and y], and its extent along tcp z.

    Cells, not a box around them: a ring is lowered over a peg.
    """

    cells: FloatArray
    below: float  # from the tcp down to its underside [m]
    above: float  # from the tcp up to its top [m]

    def surface(self, palm_above_tcp: float, margin: float = 0.0) -> FloatArray:
        """Return points (M, 3) [m] on the underside and, coarser, up to the palm, `margin` [m] outside all round."""
        turns = np.arange(8) * (np.pi / 4.0)
        offsets = margin * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        cells = self.cells if margin == 0.0 else (self.cells[:, None] + offsets).reshape(-1, 2)
        underside = _thinned(cells, _UNDERSIDE_SPACING)
        layers = [np.column_stack([underside, np.full(len(underside), self.below + margin)])]
        coarse = _thinned(cells, _SIDE_SPACING)
        top = -min(self.above + margin, palm_above_tcp)
        for z in np.linspace(top, self.below, max(2, int(np.ceil((self.below - top) / _SIDE_SPACING)) + 1))[:-1]:
            layers.append(np.column_stack([coarse, np.full(len(coarse), z)]))
        return np.concatenate(layers)

    def outline(self, hand: HandModel) -> FloatArray:
        """Return points (M, 3) [m], 16 mm apart or so, at its underside and at its top or the palm."""
        coarse = _thinned(self.cells, _SIDE_SPACING)
        levels = (self.below, -min(self.above, hand.palm_above_tcp))
        return np.concatenate([np.column_stack([coarse, np.full(len(coarse), z)]) for z in levels])


def _thinned(points: FloatArray, spacing: float) -> FloatArray:
    """Return one of the points (N, 2) in each square of edge `spacing` [m]."""
    _, first = np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)
    return points[first]


@dataclass(frozen=True, eq=False)
class HandShape:
    """The hand with its fingers `width` [m] apart (None: open), with or without an object, grown by `margin` [m]."""

    hand: HandModel
    width: float | None = None
    held: HeldObject | None = None
    margin: float = 0.0
    points: FloatArray = field(init=False, repr=False, compare=False)
    load: FloatArray = field(init=False, repr=False, compare=False)  # (M, 3) of what is held alone, coarser
    load_ball: tuple[FloatArray, float] = field(init=False, repr=False, compare=False)  # holds the load: centre, radius

    def __post_init__(self) -> None:
        points = _hand_surface(self.hand, self.width, self.margin)
        if self.held is not None:
            points = np.concatenate([points, self.held.surface(self.hand.palm_above_tcp, self.margin)])
            points.flags.writeable = False
        object.__setattr__(self, "points", points)
        load = np.zeros((0, 3)) if self.held is None else self.held.outline(self.hand)
        object.__setattr__(self, "load", load)
        middle = (load.min(axis=0) + load.max(axis=0)) / 2.0 if len(load) else np.zeros(3)
        radius = float(np.linalg.norm(load - middle, axis=1).max(initial=0.0)) + _ROUNDING
        object.__setattr__(self, "load_ball", (middle, radius))

    def boxes(self) -> list[Box]:
        """Return palm, flange, finger mounts and fingers."""
        return _boxes(self.hand, self.width)


def _boxes(hand: HandModel, width: float | None) -> list[Box]:
    inner = (hand.opening if width is None else width) / 2.0
    outer = inner + hand.finger_thickness
    palm, flange, top = -hand.palm_above_tcp, hand.flange_half_width, -hand.tcp_from_hand
    boxes = [
        Box(
            (-hand.palm_half_width, -hand.palm_half_length, top - hand.housing_top),
            (hand.palm_half_width, hand.palm_half_length, palm),
        ),
        Box((-flange, -flange, top - hand.flange_length), (flange, flange, top)),
    ]
    for sign in (-1.0, 1.0):
        finger = sorted((sign * inner, sign * outer))
        mount = sorted((sign * inner, sign * (inner + hand.mount_thickness)))
        x = hand.finger_half_width
        boxes.append(Box((-x, finger[0], palm), (x, finger[1], hand.fingertip_below_tcp)))
        boxes.append(Box((-x, mount[0], palm), (x, mount[1], -hand.mount_above_tcp)))
    return boxes


@lru_cache(maxsize=64)
def _hand_surface(hand: HandModel, width: float | None, margin: float) -> FloatArray:
    """Return points (N, 3) [m, tcp frame] of the hand's surface; plans come back to a few openings and margins."""
    points = np.concatenate([box.grown(margin).surface() for box in _boxes(hand, width)])
    points = np.round(points, 5)
    # One number a point, in the order of x, y and z: much faster to sort than rows.
    numbers = np.round(points * 1e5).astype(np.int64) + _HALF
    _, first = np.unique((numbers[:, 0] * 2 * _HALF + numbers[:, 1]) * 2 * _HALF + numbers[:, 2], return_index=True)
    points = points[first]
    points.flags.writeable = False
    return points
