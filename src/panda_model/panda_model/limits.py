"""Limits of the arm's joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ARM_DOF = 7


def frozen_array(values: npt.ArrayLike) -> FloatArray:
    """Return a copy of the values that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Bounds of the seven arm joints, each (7,): rad, rad/s, rad/s^2, rad/s^3."""

    lower: FloatArray
    upper: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

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
        return bool(np.all(positions >= self.lower - tolerance) and np.all(positions <= self.upper + tolerance))
