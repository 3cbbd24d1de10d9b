"""Limits of the arm's joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ARM_DOF = 7
_CREEP = 1e-3  # a lower bound is as good as none [rad/s]


def frozen_array(values: npt.ArrayLike) -> FloatArray:
    """Return a copy of the values that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class SlowEnds:
    """Speed limits that shrink towards the ends of a joint's range: sqrt(slope * distance) - offset, at least 0.

    lower, upper: (7,) [rad], from which the distances count; slope: (7,) [rad/s^2]; offset: (7,) [rad/s].
    """

    lower: FloatArray
    upper: FloatArray
    slope: FloatArray
    offset: FloatArray

    def velocity(self, positions: FloatArray, upwards: npt.NDArray[np.bool_]) -> FloatArray:
        """Return the greatest speeds (..., 7) [rad/s] at positions (..., 7) [rad], up or down the range."""
        distance = np.where(upwards, self.upper - positions, positions - self.lower)
        return np.maximum(np.sqrt(self.slope * np.maximum(distance, 0.0)) - self.offset, 0.0)


def velocity_ratio(
    positions: FloatArray, velocities: FloatArray, bound: npt.ArrayLike, slow_ends: SlowEnds | None
) -> FloatArray:
    """Return speeds (..., 7) [rad/s] as shares of the bound (7,) [rad/s], and of what the ends of the range allow."""
    allowed = np.broadcast_to(np.asarray(bound, dtype=np.float64), np.shape(velocities))
    if slow_ends is not None:
        allowed = np.minimum(allowed, slow_ends.velocity(positions, velocities > 0.0))
    return np.abs(velocities) / np.maximum(allowed, _CREEP)


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Bounds of the seven arm joints, each (7,): rad, rad/s, rad/s^2, rad/s^3.

    slow_ends: lower speeds near the ends of the range, for an arm that has such.
    """

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    slow_ends: SlowEnds | None = None

    def velocity_ratio(self, positions: FloatArray, velocities: FloatArray) -> FloatArray:
        """Return speeds (..., 7) [rad/s] as shares of what the limits allow at positions (..., 7) [rad].

        Where the limits allow none, even the slowest motion is a very large share.
        """
        return velocity_ratio(positions, velocities, self.velocity, self.slow_ends)

    def scaled(self, velocity: float, acceleration: float, jerk: float) -> JointLimits:
        """Return limits with the same position bounds, and the derivatives' bounds times factors in (0, 1]."""
        for name, factor in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk)):
            if not 0.0 < factor <= 1.0:
                raise ValueError(f"{name} scaling must be in (0, 1], got {factor}")
        return replace(
            self,
            velocity=frozen_array(self.velocity * velocity),
            acceleration=frozen_array(self.acceleration * acceleration),
            jerk=frozen_array(self.jerk * jerk),
        )

    def shrunk(self, margin: float) -> JointLimits:
        """Return limits with the position bounds moved inwards by `margin` [rad]."""
        return replace(self, lower=frozen_array(self.lower + margin), upper=frozen_array(self.upper - margin))

    def contains(self, positions: FloatArray, tolerance: float = 0.0) -> bool:
        """Return True if every row of (..., 7) positions [rad] lies within the position bounds."""
        inside = (positions >= self.lower - tolerance) & (positions <= self.upper + tolerance)
        return bool(inside.all())
