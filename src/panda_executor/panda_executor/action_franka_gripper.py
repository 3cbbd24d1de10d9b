"""The gripper behind the actions of franka_msgs."""

from __future__ import annotations

import time
from collections.abc import Callable

from panda_executor.action_call import TIME_FACTOR, TIME_SPARE, ActionCaller
from panda_executor.conversions import grasp_goal_to_msg, move_goal_to_msg
from panda_executor.errors import PortError
from panda_executor.joint_tracker import JointTracker
from panda_executor.ports import GripperResult, MotionStatus, ShouldStop
from panda_model.hand import HandModel

_SAME = 1e-4  # between where the fingers are and where they shall be [m]
_REACHED = 0.004  # from the width asked for [m]
_STILL = 0.001  # by which fingers that stand may be measured to move [m]
_STILL_NS = 100_000_000  # for so long, ROS time
_SETTLE = 1.5  # for the joint states to show it, wall clock [s]


class FrankaGripper:
    """GripperPort that closes by Grasp and opens by Move.

    The width of what is grasped is not known, so the grasp's epsilon is the hand's whole opening: with a narrow one the
    hand calls the grasp failed and lets go. Grasp and Move report no width; the joint states say what came of it.
    """

    def __init__(
        self,
        grasp: ActionCaller,
        move: ActionCaller,
        joints: JointTracker,
        now_ns: Callable[[], int],
        hand: HandModel,
    ) -> None:
        self._grasp, self._move, self._joints, self._now_ns, self._hand = grasp, move, joints, now_ns, hand
        # the whole way, and as much again for a hand that is slower than asked
        self._timeout = TIME_FACTOR * 2.0 * (hand.opening / hand.speed) + TIME_SPARE + 1.0
        self._halt = False

    def width(self) -> float:
        """Return the full distance between the fingers [m]. Raises PortError while the joint states are old."""
        return self._joints.width(self._now_ns())

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        """Move to a full width [m]; being stopped by an object on the way to a smaller one counts as done."""
        self._halt = False
        closes = width < self.width() - _SAME
        if closes:
            caller, goal = self._grasp, grasp_goal_to_msg(width, self._hand.speed, max_effort, self._hand.opening)
        else:
            caller, goal = self._move, move_goal_to_msg(width, self._hand.speed)
        end = caller.call(goal, self._timeout, lambda: self._halt or should_stop())
        if end.status is not MotionStatus.SUCCEEDED:
            words = end.message or (str(end.result.error) if end.result is not None else "")
            return GripperResult(float("nan"), False, False, end.status, words, end.confirmed)
        reached = self._settled_width(should_stop)
        off = reached - width
        if abs(off) <= _REACHED or (closes and off > 0.0):
            return GripperResult(reached, abs(off) > _REACHED, abs(off) <= _REACHED)
        words = f"the fingers stand at {reached:.4f} m, asked for {width:.4f} m"
        return GripperResult(reached, False, False, MotionStatus.ABORTED, words)

    def stop(self) -> None:
        """Cancel a motion that runs; the fingers stay where they are."""
        self._halt = True

    def _settled_width(self, should_stop: ShouldStop) -> float:
        """Return the width [m] at which the fingers stand, not a number while no fresh joint states say so."""
        deadline = time.monotonic() + _SETTLE
        width, since = float("nan"), self._now_ns()
        while time.monotonic() < deadline and not should_stop():
            try:
                now = self.width()
            except PortError:
                now = float("nan")
            if not abs(now - width) <= _STILL:
                width, since = now, self._now_ns()
            elif self._now_ns() - since >= _STILL_NS:
                return now
            time.sleep(0.01)
        return width
