"""The timing of a path in joint space, within velocity, acceleration and jerk limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory
from scipy.interpolate import CubicSpline

from panda_executor.errors import TrajectoryError
from panda_executor.model import PandaModel
from panda_executor.trajectory import JointTrajectory
from panda_model.limits import ARM_DOF, FloatArray, JointLimits

_HEADROOM = 0.96  # of the limits: the controller's interpolation between points needs the rest
# The profile's jerk switches between its bounds; polynomials between samples overshoot such a step.
_JERK_HEADROOM = 0.5
_PATH_SAMPLES = 60
_SUBSTEPS = np.append(np.arange(32) / 32.0, 1.0 - 1e-6)  # where the polynomial between two points is looked at
_MOST_STRETCH = 10.0  # a motion that would have to be slower by more is no motion
_STANDSTILL = 1e-7  # a path shorter than this does not move [rad]


@dataclass(frozen=True)
class TimingConfig:
    """Scaling factors of the joint limits in (0, 1]; speed limits of the tcp [m/s]; sample period [s]."""

    velocity_scaling: float = 0.5
    acceleration_scaling: float = 0.5
    jerk_scaling: float = 0.2
    tcp_speed: float = 1.0
    tcp_speed_near: float = 0.25
    period: float = 0.02


class _Path:
    """A twice continuously differentiable curve through waypoints (N, 7), by its length s [rad]."""

    def __init__(self, waypoints: FloatArray) -> None:
        steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
        points = waypoints[np.concatenate([[True], steps > 1e-9])]
        self.length = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        self._line = len(points) < 3
        s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        if self._line:
            self._start, self._direction = points[0], (points[-1] - points[0]) / max(self.length, 1e-12)
        else:
            self._spline = CubicSpline(s, points, bc_type="natural" if len(points) == 3 else "not-a-knot")

    def derivatives(self, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return q, q', q'', q''', each (M, 7), at s (M,)."""
        if self._line:
            zero = np.zeros((len(s), ARM_DOF))
            return self._start + s[:, None] * self._direction, zero + self._direction, zero, zero
        return self._spline(s), self._spline(s, 1), self._spline(s, 2), self._spline(s, 3)


def time_path(
    waypoints: FloatArray,
    limits: JointLimits,
    model: PandaModel,
    tcp_speed: float,
    period: float = 0.02,
) -> JointTrajectory:
    """Time a motion from rest to rest along a smooth curve through waypoints (N, 7) [rad].

    The path's parameter follows a time-optimal jerk-limited profile; where the curve bends, the motion is
    stretched in time until every joint is within its limits. `tcp_speed` [m/s] bounds the tcp as well.

    Raises:
        TrajectoryError: when there is no motion in the waypoints, or no profile is found.
    """
    path = _Path(np.asarray(waypoints, dtype=np.float64))
    if path.length < _STANDSTILL:
        raise TrajectoryError("the path does not move the arm")
    profile = _speed_profile(path, limits, model, tcp_speed)
    return within_limits(_sampled(path, profile, limits, model.arm.arm_joints, period), limits)


def _speed_profile(path: _Path, limits: JointLimits, model: PandaModel, tcp_speed: float) -> Trajectory:
    """Return the path's length over time, as fast as the joints where it is steepest and `tcp_speed` [m/s] let it."""
    s = np.linspace(0.0, path.length, _PATH_SAMPLES)
    q, slope, _, _ = path.derivatives(s)
    steepest = np.maximum(np.abs(slope).max(axis=0), 1e-12)
    tcp = np.array([model.tcp_arrays(row)[1] for row in q])
    tcp_slope = float((np.linalg.norm(np.diff(tcp, axis=0), axis=1) / np.diff(s)).max())
    speed = min(float((limits.velocity / steepest).min()), tcp_speed / max(tcp_slope, 1e-9))
    return _rest_to_rest(
        path.length,
        _HEADROOM * speed,
        _HEADROOM * float((limits.acceleration / steepest).min()),
        _JERK_HEADROOM * float((limits.jerk / steepest).min()),
    )


def _sampled(
    path: _Path, profile: Trajectory, limits: JointLimits, joint_names: tuple[str, ...], period: float
) -> JointTrajectory:
    """Return points every `period` [s] or so, stretched in time until those points keep the limits."""
    count = max(math.ceil(profile.duration / period), 4) + 1
    times = np.linspace(0.0, profile.duration, count)
    states = [profile.at_time(t) for t in times]
    s = np.clip(np.array([state[0][0] for state in states]), 0.0, path.length)
    ds = np.array([state[1][0] for state in states])[:, None]
    dds = np.array([state[2][0] for state in states])[:, None]
    q, d1, d2, d3 = path.derivatives(s)
    velocity = d1 * ds
    acceleration = d2 * ds**2 + d1 * dds
    jerk_bend = d3 * ds**3 + 3.0 * d2 * ds * dds  # the profile's own jerk is within its share already
    stretch = max(
        1.0,
        _slower(limits, q, velocity) / _HEADROOM,
        math.sqrt(float((np.abs(acceleration) / (limits.acceleration * _HEADROOM)).max())),
        float(np.cbrt((np.abs(jerk_bend) / (limits.jerk * (_HEADROOM - _JERK_HEADROOM))).max())),
    )
    velocity, acceleration = velocity / stretch, acceleration / stretch**2
    velocity[[0, -1]] = 0.0
    acceleration[[0, -1]] = 0.0
    return JointTrajectory(joint_names, times * stretch, q, velocity, acceleration)


def within_limits(trajectory: JointTrajectory, limits: JointLimits) -> JointTrajectory:
    """Return the trajectory stretched until the polynomials between its points keep the limits, too.

    They exceed them most where a path bends sharply.
    """
    spans = np.diff(trajectory.times)[:, None]
    fine = (trajectory.times[:-1, None] + spans * _SUBSTEPS).ravel()
    position, velocity, acceleration, jerk = trajectory.sample(fine)
    stretch = max(
        1.0,
        _slower(limits, position, velocity),
        math.sqrt(float((np.abs(acceleration) / limits.acceleration).max())),
        float(np.cbrt((np.abs(jerk) / limits.jerk).max())),
    )
    return JointTrajectory(
        trajectory.joint_names,
        trajectory.times * stretch,
        trajectory.positions,
        trajectory.velocities / stretch,
        trajectory.accelerations / stretch**2,
    )


def _slower(limits: JointLimits, positions: FloatArray, velocities: FloatArray) -> float:
    """Return by what factor a motion through positions and velocities (N, 7) must be slower.

    Raises:
        TrajectoryError: when the arm could only creep, so near the end of a joint's range.
    """
    factor = float(limits.velocity_ratio(positions, velocities).max())
    if limits.slow_ends is not None and factor > _MOST_STRETCH:
        raise TrajectoryError("the path passes so near the end of a joint's range that the arm could only creep there")
    return factor


def _rest_to_rest(length: float, speed: float, acceleration: float, jerk: float) -> Trajectory:
    """Return a one-dimensional jerk-limited profile from 0 to `length` [rad]."""
    problem = InputParameter(1)
    problem.current_position, problem.target_position = [0.0], [length]
    problem.current_velocity = problem.target_velocity = [0.0]
    problem.current_acceleration = problem.target_acceleration = [0.0]
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = [speed], [acceleration], [jerk]
    profile = Trajectory(1)
    result = Ruckig(1).calculate(problem, profile)
    if result not in (Result.Working, Result.Finished):
        raise TrajectoryError(f"no time profile for a path of {length:.3f} rad: {result}")
    return profile
