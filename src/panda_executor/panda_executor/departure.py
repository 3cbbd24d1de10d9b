"""Motions that begin where the arm was measured, not where it was planned to be."""

from __future__ import annotations

import numpy as np

from panda_executor.errors import TrajectoryError
from panda_executor.timing import within_limits
from panda_executor.trajectory import JointTrajectory
from panda_model.limits import FloatArray, JointLimits

_SAME = 1e-9  # a joint this near to the first point is there [rad]


def depart_from(
    trajectory: JointTrajectory, here: FloatArray, limits: JointLimits, tolerance: float
) -> JointTrajectory:
    """Return the trajectory begun at `here` (7,) [rad]; what it was off by fades over the whole way to the same end.

    The offset fades as a minimum-jerk polynomial, a quintic: between two points the controller's own quintic is the sum
    of both, so that nothing is lost by sampling it. It is to be validated again: another way is gone.

    Args:
        limits: that it keeps, if need be by taking longer.
        tolerance: how far the arm may be from the planned start [rad].

    Raises:
        TrajectoryError: when it is further away, or not known where.
    """
    offset = here - trajectory.start
    away = float(np.abs(offset).max())
    if not away <= tolerance:
        raise TrajectoryError(
            f"the arm is {away:.3f} rad away from where the motion begins (at most {tolerance:g}); "
            "observe again before moving"
        )
    if away < _SAME:
        return trajectory
    span = trajectory.duration - trajectory.times[0]
    u = ((trajectory.times - trajectory.times[0]) / span)[:, None]
    left = 1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    speed = -30.0 * u**2 * (1.0 - u) ** 2 / span
    acceleration = -60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / span**2
    velocities = trajectory.velocities + speed * offset
    velocities[[0, -1]] = 0.0
    begun = JointTrajectory(
        trajectory.joint_names,
        trajectory.times,
        trajectory.positions + left * offset,
        velocities,
        trajectory.accelerations + acceleration * offset,
    )
    return within_limits(begun, limits)
