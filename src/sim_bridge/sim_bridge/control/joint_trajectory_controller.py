"""The arm's trajectory controller: follows one FollowJointTrajectory goal at a time, or holds still.

Pure logic with time handed in: the ROS node and the benchmark both call `update` once a physics step.

    execution = controller.start(goal, world.time)
    while not execution.done:
        command = controller.update(world.time, world.panda.state())
        world.panda.command(command.positions, command.velocities)
        world.step()
    print(execution.status, execution.error_string)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim_bridge.control.arm_reflex import ArmControllerConfig, JointCommand, JointStates, at_rest, reflex_fault
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.trajectory_goal import (
    ErrorCode,
    GoalRejectedError,
    JointTolerance,
    TrajectoryGoal,
    validate_goal,
)
from sim_bridge.control.trajectory_spline import Array, Knot, TrajectorySpline, as_knot

__all__ = [
    "ArmControllerConfig",
    "ErrorCode",
    "GoalRejectedError",
    "GoalStatus",
    "JointCommand",
    "JointTrajectoryController",
    "TrajectoryExecution",
    "TrajectoryFeedback",
]


@dataclass(frozen=True, eq=False)
class TrajectoryFeedback:
    """Desired and actual motion at `time` [s]; arrays (7,) in rad and rad/s."""

    time: float
    desired: JointCommand
    positions: Array
    velocities: Array


class TrajectoryExecution:
    """The fate of one goal: `status` at any time, `error_code` and `error_string` once it is `done`."""

    def __init__(self, goal: TrajectoryGoal) -> None:
        self.goal = goal
        self.status = GoalStatus.EXECUTING
        self.error_code = ErrorCode.SUCCESSFUL
        self.error_string = ""

    @property
    def done(self) -> bool:
        """True if the status is final."""
        return self.status.final

    def _finish(self, status: GoalStatus, code: ErrorCode = ErrorCode.SUCCESSFUL, message: str = "") -> None:
        if not self.done:
            self.error_code, self.error_string = code, message
            self.status = status  # last: other threads wait for it


class _PathTime:
    """Maps time to time along the spline: one to one, until a brake lets it run out."""

    def __init__(self) -> None:
        self._brake: tuple[float, float, float] | None = None  # time, path time and duration of the brake

    @property
    def braking(self) -> bool:
        return self._brake is not None

    def brake(self, time: float, duration: float) -> None:
        self._brake = (time, time, max(duration, 1e-3))

    def at(self, time: float) -> tuple[float, float]:
        """Return path time [s] and its rate (1 on the way, 0 when stopped)."""
        if self._brake is None:
            return time, 1.0
        begin, path, duration = self._brake
        passed = min(time - begin, duration)
        return path + passed - passed**2 / (2.0 * duration), 1.0 - passed / duration


class JointTrajectoryController:
    """Follows goals by the rules of joint_trajectory_controller and with the reflexes of a real arm.

    `start` takes or refuses a goal; a new goal aborts the old one. `cancel` and `hold` brake along the
    trajectory's own path, so that the arm stops where it was allowed to be. A goal whose commands would jump,
    or break a joint's limits, is aborted before anything moves.
    """

    def __init__(self, config: ArmControllerConfig | None = None) -> None:
        self.config = config or ArmControllerConfig()
        self._execution: TrajectoryExecution | None = None
        self._pending: TrajectoryExecution | None = None
        self._spline: TrajectorySpline | None = None
        self._path_time = _PathTime()
        self._command: JointCommand | None = None
        self._state: JointStates | None = None
        self._time = 0.0
        self._path_tolerance = self._goal_tolerance = (np.empty(0), np.empty(0))

    @property
    def active(self) -> TrajectoryExecution | None:
        """The goal that is being executed or canceled, None when the arm holds still."""
        for execution in (self._pending, self._execution):
            if execution is not None and not execution.done:
                return execution
        return None

    def start(self, goal: TrajectoryGoal, time: float) -> TrajectoryExecution:
        """Take `goal` at `time` [s]; it begins with the next `update`. A running goal is aborted.

        Raises GoalRejectedError, with the action's error code, for a goal that the controller does not take.
        """
        validate_goal(goal, self.config.joint_names, time)
        self._abort(ErrorCode.INVALID_GOAL, "preempted by a new goal")
        self._pending = TrajectoryExecution(goal)
        return self._pending

    def check(self, goal: TrajectoryGoal, time: float, state: JointStates) -> None:
        """Raise GoalRejectedError unless `goal` would be taken and followed by an arm at rest in the measured `state`.

        A driver rejects by this at once what would otherwise be taken, and aborted at the next `update`.
        """
        validate_goal(goal, self.config.joint_names, time)
        rest = at_rest(state.positions)
        fault = reflex_fault(self._fit(goal, time, state, rest), time, state, rest, self.config)
        if fault:
            raise GoalRejectedError(ErrorCode.INVALID_GOAL, fault)

    def cancel(self) -> None:
        """Brake and hold; the goal becomes CANCELED once the arm's command stands still (within 0.25 s)."""
        if self._pending is not None:
            self._pending._finish(GoalStatus.CANCELED, message="canceled before it began")
            self._pending = None
        if self._execution is not None and not self._execution.done:
            self._execution.status = GoalStatus.CANCELING
            self._brake()

    def hold(self, reason: str) -> None:
        """Brake and hold as a watchdog does: the running goal, if any, is aborted with `reason`."""
        self._abort(ErrorCode.INVALID_GOAL, reason)
        self._brake()

    def reset(self, reason: str = "the arm was reset") -> None:
        """Forget all motion: abort any goal and hold, from the next update, wherever the arm then is."""
        self._abort(ErrorCode.INVALID_GOAL, reason)
        self._spline = self._command = self._state = None

    def feedback(self) -> TrajectoryFeedback | None:
        """Return the desired and actual motion of the last update; None before the first one."""
        if self._command is None or self._state is None:
            return None
        return TrajectoryFeedback(self._time, self._command, self._state.positions, self._state.velocities)

    def update(self, time: float, state: JointStates) -> JointCommand:
        """Return the command for `time` [s], given the measured `state`."""
        self._time, self._state = time, state
        if self._command is None:
            self._command = at_rest(state.positions)
        if self._pending is not None:
            self._begin(self._pending, time, state)
        if self._spline is not None:
            path_time, rate = self._path_time.at(time)
            positions, velocities, accelerations = self._spline.sample(path_time)
            self._command = JointCommand(positions, rate * velocities, rate * rate * accelerations)
            self._judge(time, rate, state)
        return self._command

    def _begin(self, execution: TrajectoryExecution, time: float, state: JointStates) -> None:
        """Make `execution` the running one, or abort it when the arm's reflexes would."""
        assert self._command is not None
        self._pending = None
        spline = self._fit(execution.goal, time, state, self._command)
        fault = reflex_fault(spline, time, state, self._command, self.config)
        self._execution = execution
        if fault:
            execution._finish(GoalStatus.ABORTED, ErrorCode.INVALID_GOAL, f"reflex: {fault}")
            self._brake()
            return
        self._spline, self._path_time = spline, _PathTime()
        names, config = self.config.joint_names, self.config
        self._path_tolerance = _tolerances(execution.goal.path_tolerance, names, config.path_tolerance, 0.0)
        self._goal_tolerance = _tolerances(
            execution.goal.goal_tolerance, names, config.goal_tolerance, config.stopped_velocity
        )

    def _fit(self, goal: TrajectoryGoal, time: float, state: JointStates, command: JointCommand) -> TrajectorySpline:
        """Fit a spline to `goal` in the controller's clock and joint order, beginning with the arm's present motion."""
        order = [goal.joint_names.index(name) for name in self.config.joint_names]
        start = time if goal.start_time is None else goal.start_time
        knots = [
            as_knot(
                start + point.time,
                [point.positions[i] for i in order],
                [point.velocities[i] for i in order] if point.velocities else (),
                [point.accelerations[i] for i in order] if point.accelerations else (),
            )
            for point in goal.points
        ]
        if knots[0].time <= time + 1e-9:
            return TrajectorySpline(knots)
        near = np.max(np.abs(command.positions - state.positions)) <= self.config.position_jump
        now = command if near else at_rest(state.positions)
        return TrajectorySpline([Knot(time, now.positions, now.velocities, now.accelerations), *knots])

    def _judge(self, time: float, rate: float, state: JointStates) -> None:
        """Decide whether the running goal ends now."""
        assert self._spline is not None
        assert self._command is not None
        execution = self._execution
        if execution is None or execution.done:
            return
        if self._path_time.braking:
            if rate <= 0.0:
                execution._finish(GoalStatus.CANCELED, message="canceled")
            return
        position_error = np.abs(self._command.positions - state.positions)
        velocity_error = np.abs(self._command.velocities - state.velocities)
        late = time - self._spline.end
        position_limit, velocity_limit = self._path_tolerance if late < 0.0 else self._goal_tolerance
        outside = np.flatnonzero((position_error > position_limit) | (velocity_error > velocity_limit))
        if late >= 0.0 and not outside.size:
            execution._finish(GoalStatus.SUCCEEDED)
            return
        allowance = execution.goal.goal_time_tolerance
        if not outside.size or (late >= 0.0 and (allowance == 0.0 or late <= allowance)):
            return
        joint = outside[0]
        code = ErrorCode.PATH_TOLERANCE_VIOLATED if late < 0.0 else ErrorCode.GOAL_TOLERANCE_VIOLATED
        message = (
            f"{self.config.joint_names[joint]} is {position_error[joint]:.3f} rad "
            f"and {velocity_error[joint]:.3f} rad/s off its {'path' if late < 0.0 else 'goal'}"
        )
        execution._finish(GoalStatus.ABORTED, code, message)
        self._spline, self._command = None, at_rest(state.positions)  # something pushes back: do not press on

    def _abort(self, code: ErrorCode, reason: str) -> None:
        """End the running goal: as canceled when it was being canceled, else as aborted. The arm moves on."""
        for execution in (self._execution, self._pending):
            if execution is None:
                continue
            if execution.status is GoalStatus.CANCELING:
                execution._finish(GoalStatus.CANCELED, message=f"canceled; {reason}")
            execution._finish(GoalStatus.ABORTED, code, reason)
        self._pending = None

    def _brake(self) -> None:
        """Let the motion run out along its path, as fast as the joints' acceleration limits allow."""
        if self._spline is None or self._command is None or self._path_time.braking:
            return
        needed = float(np.max(np.abs(self._command.velocities) / self.config.acceleration))
        self._path_time.brake(self._time, min(needed, self.config.max_brake_s))


def _tolerances(
    given: Mapping[str, JointTolerance], names: Sequence[str], position: float, velocity: float
) -> tuple[Array, Array]:
    """Return tolerances as arrays (joints,); infinite where a check is off."""

    def resolve(value: float, default: float) -> float:
        value = default if value == 0.0 else value
        return np.inf if value <= 0.0 else value

    chosen = [given.get(name, JointTolerance()) for name in names]
    return (
        np.array([resolve(tolerance.position, position) for tolerance in chosen]),
        np.array([resolve(tolerance.velocity, velocity) for tolerance in chosen]),
    )
