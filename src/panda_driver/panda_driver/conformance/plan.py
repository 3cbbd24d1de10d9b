"""Small motions for tests, and how far an arm was from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from panda_model.limits import FloatArray, JointLimits
from sim_bridge.control.trajectory_spline import TrajectorySpline, as_knot

_POINTS = 21
_GRID = 400


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """Times (N,) [s], positions and velocities (N, 7) [rad, rad/s]."""

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray

    @property
    def duration(self) -> float:
        """Time from the start to the last point [s]."""
        return float(self.times[-1])

    def path(self) -> FloatArray:
        """Return positions (N, 7) [rad] along the way, as a controller goes from point to point."""
        spline = TrajectorySpline([as_knot(*row) for row in zip(self.times, self.positions, self.velocities)])
        return np.array([spline.sample(time)[0] for time in np.linspace(0.0, self.duration, _GRID)])


def small_motion(start: FloatArray, limits: JointLimits, amount: float, duration: float) -> MotionPlan:
    """Return a motion of minimum jerk from `start` (7,): each joint turns by `amount` [rad] to its range's middle."""
    return straight_motion(start, start + amount * _inwards(start, limits), duration)


def straight_motion(start: FloatArray, end: FloatArray, duration: float) -> MotionPlan:
    """Return a motion of minimum jerk between two positions (7,) [rad]."""
    times = np.linspace(0.0, duration, _POINTS)
    share = times / duration
    place = 10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5
    speed = (30.0 * share**2 - 60.0 * share**3 + 30.0 * share**4) / duration
    way = end - start
    return MotionPlan(times, start + np.outer(place, way), np.outer(speed, way))


def _inwards(start: FloatArray, limits: JointLimits) -> FloatArray:
    return np.where(start > (limits.lower + limits.upper) / 2.0, -1.0, 1.0)


def deviation(plan: MotionPlan, measured: Sequence[FloatArray]) -> float:
    """Return the farthest that measured positions (7,) were from the path [rad]."""
    path = plan.path()
    return max((float(np.abs(path - positions).max(axis=1).min()) for positions in measured), default=0.0)


def spread(measured: Sequence[FloatArray]) -> float:
    """Return how far the joint moved that moved most [rad]."""
    return float(np.ptp(np.array(measured), axis=0).max()) if len(measured) else 0.0
