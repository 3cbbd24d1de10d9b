"""The gripper behind a GripperCommand action."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from panda_executor.action_call import TIME_FACTOR, TIME_SPARE, ActionCaller
from panda_executor.conversions import gripper_goal_to_msg
from panda_executor.errors import PortError
from panda_executor.joint_tracker import JointTracker
from panda_executor.ports import GripperResult, MotionStatus, ShouldStop

_MOVE_TIME = 4.0  # for the fingers' whole way, slow hands included [s]
_SETTLE = 1.0  # for the joint states to show what the action reports, wall clock [s]
_AGREES = 0.004  # [m]
_HELD_NS = 300_000_000  # for which fingers stand that hold something, ROS time


class ActionGripper:
    """GripperPort over franka_gripper's rules: it is told half of the width and reports all of it.

    Args:
        reports_full_width: False for grippers whose result is half of the width, too.
        held_from: the least width [m] at which fingers that were told to close and stand after an aborted goal hold
            something, whether or not the gripper says `stalled`; infinite where only `stalled` says so.
    """

    def __init__(
        self,
        caller: ActionCaller,
        joints: JointTracker,
        now_ns: Callable[[], int],
        reports_full_width: bool = True,
        held_from: float = math.inf,
    ) -> None:
        self._caller, self._joints, self._now_ns = caller, joints, now_ns
        self._factor = 1.0 if reports_full_width else 2.0
        self._held_from = held_from
        self._halt = False

    def width(self) -> float:
        """Return the full distance between the fingers [m]. Raises PortError while the joint states are old."""
        return self._joints.width(self._now_ns())

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        """Move to a full width [m]; being stopped by an object counts as done."""
        self._halt = False
        goal = gripper_goal_to_msg(width, max_effort)
        end = self._caller.call(goal, TIME_FACTOR * _MOVE_TIME + TIME_SPARE, lambda: self._halt or should_stop())
        if end.result is None:
            return GripperResult(float("nan"), False, False, end.status, end.message, end.confirmed)
        reported = self._factor * float(end.result.position)
        status, stalled = end.status, bool(end.result.stalled)
        if status is MotionStatus.ABORTED and (stalled or self._is_held(width, reported, should_stop)):
            status, stalled = MotionStatus.SUCCEEDED, True  # holding something is what closing is for
        if status is MotionStatus.SUCCEEDED:
            self._wait_for_states(reported, should_stop)
        return GripperResult(reported, stalled, bool(end.result.reached_goal), status, end.message)

    def stop(self) -> None:
        """Cancel a move that runs; the fingers stay where they are."""
        self._halt = True

    def _is_held(self, asked: float, reported: float, should_stop: ShouldStop) -> bool:
        """Return True if the fingers stand [m, full widths] where they must hold something.

        franka_gripper aborts where the width is outside of its epsilon and never says `stalled`. What it does then
        differs with its version: the fingers hold on, or open again. The joint states tell.
        """
        if not asked < self._held_from <= reported:
            return False
        self._wait_for_states(reported, should_stop)
        begin, deadline = self._now_ns(), time.monotonic() + _SETTLE
        while self._now_ns() - begin < _HELD_NS:
            if should_stop() or time.monotonic() > deadline:
                return False
            try:
                if abs(self.width() - reported) > _AGREES:
                    return False
            except PortError:
                return False
            time.sleep(0.01)
        return True

    def _wait_for_states(self, width: float, should_stop: ShouldStop) -> None:
        """Wait until the joint states show `width` [m]: they come a moment later, and grasps are judged by them."""
        deadline = time.monotonic() + _SETTLE
        while time.monotonic() < deadline and not should_stop():
            try:
                if abs(self.width() - width) < _AGREES:
                    return
            except PortError:
                pass
            time.sleep(0.01)
