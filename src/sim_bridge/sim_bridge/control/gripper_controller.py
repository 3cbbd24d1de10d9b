"""The hand's controller: moves and grasps as franka_gripper's gripper_action does.

Pure logic with time handed in: the ROS node and the benchmark both call `update` once a physics step.

    execution = gripper.start(GripperGoal(position=0.0, max_effort=20.0), world.time)
    while not execution.done:
        command = gripper.update(world.time, world.panda.state())
        world.panda.command_fingers(command.width, command.max_effort)
        world.step()
    print(execution.status, execution.result.width)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_goal import GripperGoal, GripperGoalError, HandFault, HandTask
from sim_bridge.control.trajectory_spline import Array
from sim_bridge.robot import HAND

__all__ = [
    "GoalStatus",
    "GripperCommand",
    "GripperConfig",
    "GripperController",
    "GripperExecution",
    "GripperGoal",
    "GripperGoalError",
    "GripperResult",
    "HandFault",
    "HandTask",
]


class FingerStates(Protocol):
    """Measured fingers: distance of each from the middle (2,) [m] and its speed (2,) [m/s]."""

    @property
    def finger_positions(self) -> Array:
        """Distances from the middle (2,) [m]."""
        ...

    @property
    def finger_velocities(self) -> Array:
        """Speeds (2,) [m/s]."""
        ...


@dataclass(frozen=True)
class GripperConfig:
    """Rules and limits of the hand. Widths are the full distance between the fingers [m], forces in N.

    With `franka_quirks` the rules are franka_gripper's: `stalled` is never set, and a grasp that ends outside
    of target - `epsilon_inner` .. target + `epsilon_outer` fails and opens the hand again, unless its goal has
    epsilons of its own (franka_msgs/Grasp). The epsilons are as wide as the hand by default: franka_gripper's own, for
    GripperCommand, are 0.005 m. Without the quirks the rules are those of ros2_controllers' GripperActionController:
    fingers that an object stops are reported as `stalled`, and hold it.
    """

    max_width: float = HAND.opening
    speed: float = HAND.speed
    default_effort: float = 20.0
    max_effort: float = HAND.allowed_force
    epsilon_inner: float = HAND.opening
    epsilon_outer: float = HAND.opening
    franka_quirks: bool = True
    position_tolerance: float = 0.001
    settle_speed: float = 0.008
    settle_time: float = 0.1
    allowance: float = 2.0
    fault: HandFault = HandFault.NONE


@dataclass(frozen=True)
class GripperCommand:
    """Command to the fingers: full width [m] and the greatest force of each finger [N]."""

    width: float
    max_effort: float


@dataclass(frozen=True)
class GripperResult:
    """Result of the hand: full `width` [m], `effort` [N], and the two flags of GripperCommand's result."""

    width: float
    effort: float
    stalled: bool
    reached_goal: bool


class GripperExecution:
    """The fate of one goal; `result` is set once it is `done`, `message` says what went wrong."""

    def __init__(self, goal: GripperGoal) -> None:
        self.goal = goal
        self.status = GoalStatus.EXECUTING
        self.result: GripperResult | None = None
        self.message = ""

    @property
    def done(self) -> bool:
        """True if the status is final."""
        return self.status.final

    def _finish(self, status: GoalStatus, result: GripperResult, message: str = "") -> None:
        if not self.done:
            self.result, self.message = result, message
            self.status = status  # last: other threads wait for it


class GripperController:
    """Moves the fingers to one goal at a time; it opens by position and closes by force."""

    def __init__(self, config: GripperConfig | None = None) -> None:
        self.config = config or GripperConfig()
        self._execution: GripperExecution | None = None
        self._time = 0.0
        self._width: float | None = None
        self._speed = 0.0
        self._command = GripperCommand(self.config.max_width, self.config.default_effort)
        self._target: float | None = None  # None: whatever width the next update finds
        self._started = 0.0
        self._moved = 0.0
        self._grasping = False
        self.fault = self.config.fault
        self.jammed_for: float | None = None  # a hand that cannot move says so after this [s]; None: it can

    @property
    def active(self) -> GripperExecution | None:
        """The goal that is being executed, None when the hand holds still."""
        return self._execution if self._execution is not None and not self._execution.done else None

    def check(self, goal: GripperGoal) -> None:
        """Raise GripperGoalError unless `goal` would be taken."""
        width, most = 2.0 * goal.position, self.config.max_width
        if not -1e-6 <= width <= most + 1e-6:
            raise GripperGoalError(f"position {goal.position:g} m is half a width: it must be in 0..{most / 2:g} m")
        if not 0.0 <= goal.max_effort < math.inf:
            raise GripperGoalError(f"max_effort must be zero (default) or positive, got {goal.max_effort:g} N")
        if not 0.0 <= goal.speed < math.inf:
            raise GripperGoalError(f"speed must be zero (the hand's) or positive, got {goal.speed:g} m/s")

    def start(self, goal: GripperGoal, time: float) -> GripperExecution:
        """Take `goal` at `time` [s]; it begins with the next `update`. A running goal is aborted.

        Raises GripperGoalError when the width is outside of the hand's range or a value is not finite.
        """
        self.check(goal)
        self._end(GoalStatus.ABORTED, "preempted by a new goal")
        self._execution = GripperExecution(goal)
        self._started = self._moved = time
        self._target = min(max(2.0 * goal.position, 0.0), self.config.max_width)
        # Measured, not commanded: after a grasp the command lies inside of the object.
        current = self._command.width if self._width is None else self._width
        closes = self._target < current - 1e-4
        self._grasping = goal.task is HandTask.GRASP or (closes and goal.task is HandTask.COMMAND)
        effort = min(goal.max_effort or self.config.default_effort, self.config.max_effort)
        # A tighter grasp starts where the last one presses; the object is not let go in between.
        begin = min(self._command.width, current) if self._grasping else current
        self._command = GripperCommand(begin, effort)
        self._fail_if_broken(goal.task)
        return self._execution

    def _fail_if_broken(self, task: HandTask) -> None:
        """Abort the goal at once, fingers where they are, on a hand that does not do it."""
        if self.fault is HandFault.NEVER_HOMED and task is HandTask.HOMING:
            self.fault = HandFault.NONE
        if self.fault is not HandFault.NONE:
            self._target = self._width
            self._end(GoalStatus.ABORTED, f"libfranka gripper: command failed ({self.fault.value})")

    def cancel(self) -> None:
        """Stop the fingers where they are; the goal becomes CANCELED."""
        self._stop()
        self._end(GoalStatus.CANCELED, "canceled")

    def hold(self, reason: str) -> None:
        """Stop the fingers where they are; the running goal, if any, is aborted with `reason`."""
        self._stop()
        self._end(GoalStatus.ABORTED, reason)

    def reset(self, reason: str = "the hand was reset") -> None:
        """Abort any goal and hold, from the next update, whatever width the hand then has."""
        self._end(GoalStatus.ABORTED, reason)
        self._target = self._width = None

    def feedback(self) -> GripperResult:
        """Return the full width and the effort as they are now."""
        return self._report(reached_goal=False)

    def update(self, time: float, state: FingerStates) -> GripperCommand:
        """Return the command for `time` [s], given the measured `state`."""
        passed = max(time - self._time, 0.0)
        self._time = time
        self._width = float(np.sum(state.finger_positions))
        self._speed = float(np.max(np.abs(state.finger_velocities)))
        if self._target is None:
            self._target = self._width
            self._command = GripperCommand(self._width, self.config.default_effort)
        if self.jammed_for is not None and self.active is not None:
            if time - self._started > self.jammed_for:
                self._end(GoalStatus.ABORTED, f"stopped at {self._width:.4f} m on the way to {self._target:.4f} m")
            return self._command
        stride = self._goal_speed() * min(passed, 0.1)
        gap = self._target - self._command.width
        width = self._command.width + math.copysign(min(abs(gap), stride), gap)
        self._command = GripperCommand(width, self._command.max_effort)
        if self.active is not None:
            self._judge(time, self._width, self._target)
        return self._command

    def _judge(self, time: float, width: float, target: float) -> None:
        """Decide whether the running goal ends now: the fingers rest and the command has gone past them."""
        error = width - target
        arrived = abs(error) <= self.config.position_tolerance
        blocked = abs(self._command.width - width) > 2.0 * self.config.position_tolerance
        spent = abs(self._command.width - target) < 1e-9
        if self._speed > self.config.settle_speed or not (arrived or blocked or spent):
            self._moved = time
        limit = self.config.max_width / self._goal_speed() + self.config.allowance
        if time - self._moved < self.config.settle_time:
            if time - self._started > limit:
                self._end(GoalStatus.ABORTED, f"the fingers did not settle within {limit:.1f} s")
            return
        if not self.config.franka_quirks:
            self._finish(GoalStatus.SUCCEEDED, self._report(reached_goal=arrived, stalled=not arrived))
        elif self._grasping and not self._is_within_epsilon(error):
            self._end(GoalStatus.ABORTED, f"closed to {width:.4f} m, outside of the grasp's epsilon: opened again")
            self._target = self.config.max_width
        elif self._grasping or arrived:
            self._finish(GoalStatus.SUCCEEDED, self._report(reached_goal=True))
        else:
            self._end(GoalStatus.ABORTED, f"stopped at {width:.4f} m on the way to {target:.4f} m")

    def _goal_speed(self) -> float:
        """Return the speed [m/s] of the width: the goal's own, at most the hand's."""
        asked = self._execution.goal.speed if self._execution is not None else 0.0
        return min(asked or self.config.speed, self.config.speed)

    def _is_within_epsilon(self, error: float) -> bool:
        """Return True if a grasp that ended so far [m] from its width is one by franka_gripper's rule."""
        own = self._execution.goal.epsilon if self._execution is not None else None
        inner, outer = own or (self.config.epsilon_inner, self.config.epsilon_outer)
        return -inner <= error <= outer

    def _report(self, *, reached_goal: bool, stalled: bool = False) -> GripperResult:
        width = self._command.width if self._width is None else self._width
        pressing = abs(self._command.width - width) > self.config.position_tolerance
        return GripperResult(width, self._command.max_effort if pressing else 0.0, stalled, reached_goal)

    def _end(self, status: GoalStatus, message: str) -> None:
        self._finish(status, self._report(reached_goal=False), message)

    def _finish(self, status: GoalStatus, result: GripperResult, message: str = "") -> None:
        if self._execution is not None:
            self._execution._finish(status, result, message)

    def _stop(self) -> None:
        """Hold the present width; an object between the fingers stays held."""
        if self._width is None or self.active is None:
            return
        pressing = self._grasping and self._command.width < self._width - self.config.position_tolerance
        self._target = self._command.width if pressing else self._width
        self._command = GripperCommand(self._target, self._command.max_effort)
