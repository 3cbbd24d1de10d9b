"""Joint limits of the arm and named configurations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

ARM_DOF = 7


def _frozen(values: npt.ArrayLike) -> FloatArray:
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
        """The same position bounds with the derivatives' bounds times factors in (0, 1]."""
        for name, factor in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk)):
            if not 0.0 < factor <= 1.0:
                raise ValueError(f"{name} scaling must be in (0, 1], got {factor}")
        return replace(
            self,
            velocity=_frozen(self.velocity * velocity),
            acceleration=_frozen(self.acceleration * acceleration),
            jerk=_frozen(self.jerk * jerk),
        )

    def shrunk(self, margin: float) -> JointLimits:
        """Position bounds moved inwards by `margin` [rad]."""
        return replace(self, lower=_frozen(self.lower + margin), upper=_frozen(self.upper - margin))

    def contains(self, positions: FloatArray, tolerance: float = 0.0) -> bool:
        """Whether every row of (..., 7) positions [rad] lies within the position bounds."""
        return bool(np.all(positions >= self.lower - tolerance) and np.all(positions <= self.upper + tolerance))


# Franka's published limits of the Panda (FER).
PANDA_LIMITS = JointLimits(
    lower=_frozen([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]),
    upper=_frozen([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]),
    velocity=_frozen([2.175] * 4 + [2.61] * 3),
    acceleration=_frozen([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
    jerk=_frozen([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
)

READY_POSITIONS = _frozen([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])

# Franka's published limits of the FR3; its velocity limits shrink near the ends of a joint's range.
FR3_LIMITS = JointLimits(
    lower=_frozen([-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159]),
    upper=_frozen([2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159]),
    velocity=_frozen([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
    acceleration=_frozen([10.0] * 7),
    jerk=_frozen([5000.0] * 7),
)
