"""Content of a FollowJointTrajectory goal, and the reasons for which a controller refuses it.

The rules are those of ros2_controllers' joint_trajectory_controller, which real arms run.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from sim_bridge.errors import SimBridgeError

MAX_START_DELAY_S = 60.0
"""A goal stamped further ahead than this comes from another clock, not from a patient client."""


class ErrorCode(IntEnum):
    """Error codes of control_msgs/action/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class GoalRejectedError(SimBridgeError):
    """A goal that the controller does not take. `code` says why in the action's own terms."""

    def __init__(self, code: ErrorCode, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class JointTolerance:
    """Tolerance of one joint [rad, rad/s]: 0 takes the controller's default, -1 switches the check off."""

    position: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True)
class TrajectoryPoint:
    """A waypoint `time` [s] after the start; rad, rad/s, rad/s^2 in the goal's joint order; may be empty."""

    time: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()


@dataclass(frozen=True)
class TrajectoryGoal:
    """A FollowJointTrajectory goal in plain values.

    `start_time` is the trajectory's zero on the controller's clock [s]; None means now (a zero stamp).
    `goal_time_tolerance` [s]: how late the arm may reach the goal tolerances; 0 waits for ever.
    """

    joint_names: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]
    start_time: float | None = None
    path_tolerance: Mapping[str, JointTolerance] = field(default_factory=dict)
    goal_tolerance: Mapping[str, JointTolerance] = field(default_factory=dict)
    goal_time_tolerance: float = 0.0

    @classmethod
    def from_arrays(
        cls,
        joint_names: Sequence[str],
        times: ArrayLike,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        accelerations: ArrayLike | None = None,
        goal_time_tolerance: float = 0.0,
    ) -> TrajectoryGoal:
        """Make a goal that starts now from `times` (N,) [s] and (N, joints) arrays [rad, rad/s, rad/s^2]."""

        def rows(values: ArrayLike | None, count: int) -> list[tuple[float, ...]]:
            if values is None:
                return [()] * count
            return [tuple(row) for row in np.asarray(values, dtype=float).tolist()]

        stamps = np.asarray(times, dtype=float).tolist()
        columns = [rows(values, len(stamps)) for values in (positions, velocities, accelerations)]
        points = tuple(TrajectoryPoint(*point) for point in zip(stamps, *columns, strict=True))
        return cls(tuple(joint_names), points, goal_time_tolerance=goal_time_tolerance)


def validate_goal(goal: TrajectoryGoal, joint_names: Sequence[str], now: float) -> None:
    """Raise GoalRejectedError unless the controller of `joint_names` would take `goal` at time `now` [s]."""
    _check_joints(goal, joint_names)
    _check_points(goal)
    _check_tolerances(goal, joint_names)
    if goal.start_time is None:
        return
    end = goal.start_time + goal.points[-1].time
    if end < now:
        raise GoalRejectedError(
            ErrorCode.OLD_HEADER_TIMESTAMP,
            f"the trajectory ended {now - end:.3f} s ago; stamp it with the time now, or with zero",
        )
    if goal.start_time > now + MAX_START_DELAY_S:
        raise GoalRejectedError(
            ErrorCode.INVALID_GOAL,
            f"the trajectory starts {goal.start_time - now:.1f} s from now (limit {MAX_START_DELAY_S:.0f} s)"
            ": does the client follow /clock (use_sim_time)?",
        )


def _invalid(message: str) -> GoalRejectedError:
    return GoalRejectedError(ErrorCode.INVALID_GOAL, message)


def _check_joints(goal: TrajectoryGoal, joint_names: Sequence[str]) -> None:
    if len(goal.joint_names) == len(joint_names) and set(goal.joint_names) == set(joint_names):
        return
    missing = [name for name in joint_names if name not in goal.joint_names]
    foreign = [name for name in goal.joint_names if name not in joint_names]
    raise GoalRejectedError(
        ErrorCode.INVALID_JOINTS,
        f"the goal must name each joint of the arm once: missing {missing}, unknown {foreign}, "
        f"{len(goal.joint_names)} names for {len(joint_names)} joints",
    )


def _check_points(goal: TrajectoryGoal) -> None:
    if not goal.points:
        raise _invalid("the trajectory has no points")
    if goal.points[0].time < 0.0:
        raise _invalid(f"point 0 has the negative time {goal.points[0].time:g} s")
    previous = -math.inf
    for index, point in enumerate(goal.points):
        if not point.time > previous:
            raise _invalid(f"times must strictly increase: point {index} is at {point.time:g} s after {previous:g} s")
        previous = point.time
        _check_sizes(index, point, len(goal.joint_names))
    if any(point.time == math.inf for point in goal.points):
        raise _invalid("a point has an infinite time")
    last = goal.points[-1].velocities
    if any(abs(velocity) > 1e-9 for velocity in last):
        raise _invalid(f"the last point must be at rest, its fastest joint moves at {max(map(abs, last)):g} rad/s")


def _check_sizes(index: int, point: TrajectoryPoint, joints: int) -> None:
    if len(point.positions) != joints:
        raise _invalid(f"point {index} has {len(point.positions)} positions for {joints} joints")
    if point.accelerations and not point.velocities:
        raise _invalid(f"point {index} has accelerations but no velocities")
    for name, values in (("velocities", point.velocities), ("accelerations", point.accelerations)):
        if values and len(values) != joints:
            raise _invalid(f"point {index} has {len(values)} {name} for {joints} joints")
    if not all(map(math.isfinite, (*point.positions, *point.velocities, *point.accelerations))):
        raise _invalid(f"point {index} has a value that is not finite")


def _check_tolerances(goal: TrajectoryGoal, joint_names: Sequence[str]) -> None:
    for tolerances in (goal.path_tolerance, goal.goal_tolerance):
        for name, tolerance in tolerances.items():
            if name not in joint_names:
                raise GoalRejectedError(ErrorCode.INVALID_JOINTS, f"a tolerance names the unknown joint {name!r}")
            for value in (tolerance.position, tolerance.velocity):
                if not (value >= 0.0 or value == -1.0):
                    raise _invalid(f"tolerance of {name} is {value:g}: 0 is the default, -1 unlimited, else positive")
    if not 0.0 <= goal.goal_time_tolerance < math.inf:
        raise _invalid(f"goal_time_tolerance must be zero or positive, got {goal.goal_time_tolerance:g} s")
