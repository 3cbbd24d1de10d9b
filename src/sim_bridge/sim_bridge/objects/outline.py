"""Outline of a flat thing from above."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_bridge.geometry import outlines

FloatArray = npt.NDArray[np.float64]
Points = list[tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Outline:
    """Outline with corners (N, 2) counter-clockwise and each hole (K, 2)
    clockwise [m], the first corner not repeated."""

    corners: FloatArray
    holes: tuple[FloatArray, ...] = ()

    @classmethod
    def from_mm(cls, corners: npt.ArrayLike, holes: Sequence[npt.ArrayLike] = ()) -> Outline:
        """Return the outline of corners [mm] in order, clockwise or not.

        Raises:
            SimulationError: when a ring has fewer than three corners or no area.
        """
        first, *others = outlines.oriented(corners, holes)
        return cls(first / 1000.0, tuple(hole / 1000.0 for hole in others))

    @property
    def centroid(self) -> FloatArray:
        """Middle of its area, (2,) [m]."""
        area, moment = 0.0, np.zeros(2)
        for ring in (self.corners, *self.holes):
            following = np.roll(ring, -1, axis=0)
            cross = ring[:, 0] * following[:, 1] - following[:, 0] * ring[:, 1]
            area += float(cross.sum()) / 2.0
            moment += ((ring + following) * cross[:, None]).sum(axis=0) / 6.0
        return moment / area

    def inset(self, by: float) -> Outline:
        """Return the same with every edge moved inwards [m]; holes grow."""
        return Outline(_moved(self.corners, by), tuple(_moved(hole, by) for hole in self.holes))


def _moved(ring: FloatArray, by: float) -> FloatArray:
    """Return a ring with every edge moved to its left [m]."""
    edges = np.roll(ring, -1, axis=0) - ring
    after = np.stack([-edges[:, 1], edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
    before = np.roll(after, 1, axis=0)
    moved: FloatArray = ring + by * (before + after) / (1.0 + (before * after).sum(axis=1, keepdims=True))
    return moved


def arc(middle: tuple[float, float], radii: tuple[float, float], start: float, end: float, corners: int) -> Points:
    """Return corners on an ellipse from one angle up to another [degrees], which is left out."""
    angles = np.radians(np.linspace(start, end, corners, endpoint=False))
    x, y = middle[0] + radii[0] * np.cos(angles), middle[1] + radii[1] * np.sin(angles)
    return list(zip(x.tolist(), y.tolist(), strict=True))
