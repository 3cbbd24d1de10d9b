"""Outlines of the kitting shapes that are no letters, in the middle of their bounding boxes; sizes in mm, x by y.

See docs/benchmark.md, "Kitting shapes".
"""

from __future__ import annotations

import numpy as np

from sim_bridge.objects.outline import Outline, arc

_ROUND = 48  # corners of a full circle


def triangle() -> Outline:
    """Return an isosceles triangle, 60 x 60, its tip towards -y."""
    return Outline.from_mm([(0, -30), (30, 30), (-30, 30)])


def rectangle(width: float, depth: float) -> Outline:
    """Return a rectangle of width (x) by depth (y) [mm]."""
    x, y = width / 2, depth / 2
    return Outline.from_mm([(-x, -y), (x, -y), (x, y), (-x, y)])


def plus() -> Outline:
    """Return a plus, 60 x 60, its bars 30 wide."""
    quarter = np.array([(30, -15), (30, 15), (15, 15)])
    turn = np.array([(0, 1), (-1, 0)])
    return Outline.from_mm(np.concatenate([quarter @ np.linalg.matrix_power(turn, k) for k in range(4)]))


def diamond() -> Outline:
    """Return a diamond, 75 x 60."""
    return Outline.from_mm([(0, -30), (37.5, 0), (0, 30), (-37.5, 0)])


def pentagon() -> Outline:
    """Return a regular pentagon, 57.2 x 54.4, a tip towards -y."""
    return Outline.from_mm(arc((0.0, 2.85), (30.07, 30.07), -90.0, 270.0, 5))


def hexagon() -> Outline:
    """Return a regular hexagon, 52 x 60, a tip towards +y."""
    return Outline.from_mm(arc((0.0, 0.0), (30.0, 30.0), -90.0, 270.0, 6))


def star() -> Outline:
    """Return a star of five points, 57.5 x 60.5, one towards +x."""
    tips = arc((-3.0, 0.0), (31.8, 31.8), 0.0, 360.0, 5)
    notches = arc((-3.0, 0.0), (15.9, 15.9), 36.0, 396.0, 5)
    return Outline.from_mm([corner for pair in zip(tips, notches, strict=True) for corner in pair])


def flower() -> Outline:
    """Return four half circles on the sides of a square, 60 x 60."""
    lobes = [arc((0, 0), (15, 15), a - 90, a + 90, _ROUND // 4) for a in (0, 90, 180, 270)]
    middles = np.array([(15, 0), (0, 15), (-15, 0), (0, -15)])
    return Outline.from_mm(np.concatenate([lobe + middle for lobe, middle in zip(lobes, middles, strict=True)]))


def circle() -> Outline:
    """Return a circle, 60 across."""
    return Outline.from_mm(arc((0.0, 0.0), (30.0, 30.0), 0.0, 360.0, _ROUND))


def ring() -> Outline:
    """Return a ring, 60 across, its hole 25.4."""
    return Outline.from_mm(
        arc((0.0, 0.0), (30.0, 30.0), 0.0, 360.0, _ROUND),
        [arc((0.0, 0.0), (12.7, 12.7), 0.0, 360.0, _ROUND // 2)],
    )


def heart() -> Outline:
    """Return a heart, 57.5 x 52.8, its tip towards -y."""
    lobe = arc((12.2, 9.3), (16.55, 17.1), 0.0, 90.0, 8) + arc((12.2, 18.3), (12.2, 8.1), 90.0, 180.0, 6)
    share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None]
    tip, bend, side = np.array([0.0, -26.4]), np.array([24.0, -8.0]), np.array([28.75, 9.3])
    flank = (1 - share) ** 2 * tip + 2 * share * (1 - share) * bend + share**2 * side
    right = np.concatenate([flank, lobe, [(0.0, 18.3)]])
    return Outline.from_mm(np.concatenate([right, (right * (-1, 1))[-2:0:-1]]))
