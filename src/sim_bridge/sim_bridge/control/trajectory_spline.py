"""Interpolation between trajectory points: linear, cubic or quintic, by what two neighbours carry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Knot:
    """A time [s] and joint values (joints,) in rad, rad/s, rad/s^2; None where they are not prescribed."""

    time: float
    positions: Array
    velocities: Array | None = None
    accelerations: Array | None = None


class TrajectorySpline:
    """A piecewise polynomial q(t) through knots; constant before the first and after the last one.

    A segment whose two ends carry velocities and accelerations is quintic, with velocities only it is cubic,
    else linear (as joint_trajectory_controller does).
    """

    def __init__(self, knots: Sequence[Knot]) -> None:
        """Fit the segments between `knots` (at least one, times strictly increasing)."""
        if not knots:
            raise ValueError("a spline needs at least one knot")
        joints = len(knots[0].positions)
        self._knots = np.array([knot.time for knot in knots])
        # (segments, 6, joints): coefficients of rising powers of the time since the segment's start
        self._coefficients = np.zeros((max(len(knots) - 1, 1), 6, joints))
        if len(knots) == 1:
            self._coefficients[0, 0] = knots[0].positions
        for index, (left, right) in enumerate(pairwise(knots)):
            self._coefficients[index] = _segment(left, right)
        powers = np.arange(6.0)[:, None]
        self._first = powers[1:] * self._coefficients[:, 1:]
        self._second = powers[1:5] * self._first[:, 1:]

    @property
    def start(self) -> float:
        """Time of the first knot [s]."""
        return float(self._knots[0])

    @property
    def end(self) -> float:
        """Time of the last knot [s]."""
        return float(self._knots[-1])

    def sample(self, time: float) -> tuple[Array, Array, Array]:
        """Return position [rad], velocity [rad/s], acceleration [rad/s^2], each (joints,), at `time` [s]."""
        index = min(max(int(np.searchsorted(self._knots, time, side="right")) - 1, 0), len(self._coefficients) - 1)
        tau = min(max(time, self.start), self.end) - self._knots[index]
        powers = tau ** np.arange(6.0)
        positions = powers @ self._coefficients[index]
        if not self.start <= time < self.end:
            return positions, np.zeros_like(positions), np.zeros_like(positions)
        return positions, powers[:5] @ self._first[index], powers[:4] @ self._second[index]

    def sweep(self, step: float) -> tuple[Array, Array, Array]:
        """Return times (N,), positions and velocities (N, joints), at most `step` [s] apart.

        Both ends of each segment are included, so the times of inner knots occur twice.
        """
        times, positions, velocities = [], [], []
        for index, (left, right) in enumerate(pairwise(self._knots)):
            tau = np.linspace(0.0, right - left, max(int(np.ceil((right - left) / step)), 1) + 1)
            powers = tau[:, None] ** np.arange(6.0)
            times.append(left + tau)
            positions.append(powers @ self._coefficients[index])
            velocities.append(powers[:, :5] @ self._first[index])
        if not times:
            rest = self._coefficients[0, :1]
            return self._knots.copy(), rest.copy(), np.zeros_like(rest)
        return np.concatenate(times), np.concatenate(positions), np.concatenate(velocities)


def _segment(left: Knot, right: Knot) -> Array:
    """Return coefficients (6, joints) of the polynomial from `left` to `right`; h: its duration [s]."""
    h = right.time - left.time
    coefficients = np.zeros((6, len(left.positions)))
    coefficients[0] = left.positions
    delta = right.positions - left.positions
    if left.velocities is None or right.velocities is None:
        coefficients[1] = delta / h
        return coefficients
    v0, v1 = left.velocities, right.velocities
    coefficients[1] = v0
    if left.accelerations is None or right.accelerations is None:
        coefficients[2] = (3.0 * delta - (2.0 * v0 + v1) * h) / h**2
        coefficients[3] = (-2.0 * delta + (v0 + v1) * h) / h**3
        return coefficients
    a0, a1 = left.accelerations, right.accelerations
    coefficients[2] = a0 / 2.0
    coefficients[3] = (20.0 * delta - (8.0 * v1 + 12.0 * v0) * h - (3.0 * a0 - a1) * h**2) / (2.0 * h**3)
    coefficients[4] = (-30.0 * delta + (14.0 * v1 + 16.0 * v0) * h + (3.0 * a0 - 2.0 * a1) * h**2) / (2.0 * h**4)
    coefficients[5] = (12.0 * delta - 6.0 * (v1 + v0) * h + (a1 - a0) * h**2) / (2.0 * h**5)
    return coefficients


def as_knot(time: float, positions: ArrayLike, velocities: ArrayLike = (), accelerations: ArrayLike = ()) -> Knot:
    """Make a knot from sequences; empty ones are not prescribed."""

    def given(values: ArrayLike) -> Array | None:
        array = np.asarray(values, dtype=float)
        return array if array.size else None

    return Knot(time, np.asarray(positions, dtype=float), given(velocities), given(accelerations))
