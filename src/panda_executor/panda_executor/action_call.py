"""One goal of an action, from sending to result, as a call that blocks."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient
from rclpy.callback_groups import CallbackGroup
from rclpy.clock import ROSClock
from rclpy.node import Node

from panda_executor.action_goal import OwnedGoal
from panda_executor.clock_watch import ClockWatch
from panda_executor.ports import MotionStatus, ShouldStop
from panda_executor.work_pulse import WorkPulse

_POLL = 0.01  # between two looks at should_stop [s]
_ANSWER_TIME = 3.0  # for the server's answer to a goal, wall clock [s]
_CANCEL_TIME = 1.0  # for a cancelled goal's end, wall clock [s]
_GRACE = 0.1  # of that, until whoever watches this process is to cancel as well [s]
_STANDSTILL = 5.0  # ROS time that does not move for so long, wall clock, will not move again [s]
TIME_FACTOR = 1.2  # a motion may take so much longer than planned, and
TIME_SPARE = 0.5  # this on top [s]
_CHECK_SERVER = 0.25  # between two looks for the server, wall clock [s]


@dataclass(frozen=True)
class ActionEnd:
    """The end of a goal; `result` is the action's result message when there is one.

    confirmed: False where the server never said that the goal is over: it may still be executed.
    """

    status: MotionStatus
    result: Any = None
    message: str = ""
    confirmed: bool = True


class ActionCaller:
    """Sends goals to one action server, one at a time, and sees each to its end.

    Must be called from a thread other than those that the client's callbacks need.

    Args:
        pulse: is told of every look at a goal: what is owned is being watched.
    """

    def __init__(
        self, node: Node, action_type: Any, name: str, group: CallbackGroup, pulse: WorkPulse | None = None
    ) -> None:
        self._node, self._name, self._pulse = node, name, pulse or WorkPulse(time.monotonic, math.inf)
        self._client = ActionClient(node, action_type, name, callback_group=group)
        self._cancel_service = node.create_client(CancelGoal, cancel_service(name), callback_group=group)
        self._now: Callable[[], float] = lambda: node.get_clock().now().nanoseconds * 1e-9

    def is_ready(self) -> bool:
        """Return True if the server is there."""
        return bool(self._client.server_is_ready())

    def cancel_all(self) -> None:
        """Cancel every goal at the server, whoever sent it; does not wait for the answer."""
        self._post(lambda: self._cancel_service.call_async(CancelGoal.Request()))

    def call(
        self, goal: Any, timeout: float, should_stop: ShouldStop, on_accepted: Callable[[], None] = lambda: None
    ) -> ActionEnd:
        """Send a goal and wait for its end. Whatever ends the wait, the goal is over or cancelled when this returns.

        Args:
            timeout: of the motion, in ROS time [s]. A clock that stands still ends the wait, too.
            on_accepted: called once the server has taken the goal.

        Raises:
            PortError: when the clock jumped on the way, once the goal is cancelled.
            Exception: what should_stop raises, once the goal is cancelled.
        """
        if not self._client.wait_for_server(timeout_sec=1.0):
            return ActionEnd(MotionStatus.UNAVAILABLE, message=f"no action server at {self._name}")
        if should_stop():
            return ActionEnd(MotionStatus.CANCELLED, message="stopped before it was sent")
        self._pulse.begin()
        mine = OwnedGoal(self._client, goal, self._post)
        confirmed = True
        try:
            cause = self._accepted(mine, should_stop)
            if cause is None:
                on_accepted()
                cause = self._watch(mine, timeout, should_stop)
        finally:
            if not mine.ended.is_set():
                confirmed = self._withdraw(mine)
            if confirmed:  # else the goal may still be executed, and nobody watches it: the heartbeat has to end
                self._pulse.end()
        if cause is None:
            return self._ended(mine)
        if not confirmed:
            return replace(cause, message=f"{cause.message}; the cancel was not confirmed", confirmed=False)
        return replace(cause, result=mine.answer.result if mine.answer is not None else None)

    def _accepted(self, mine: OwnedGoal, should_stop: ShouldStop) -> ActionEnd | None:
        """Wait for the server's answer: None once it has taken the goal, otherwise why to give it up."""
        deadline = time.monotonic() + _ANSWER_TIME
        while mine.accepted is None:
            self._pulse.beat()
            if should_stop():
                return ActionEnd(MotionStatus.CANCELLED, message="stopped on request")
            if time.monotonic() > deadline:
                return ActionEnd(MotionStatus.UNAVAILABLE, message=f"no answer from {self._name}")
            time.sleep(_POLL)
        if not mine.accepted:
            return ActionEnd(MotionStatus.REJECTED, message=f"{self._name} did not take the goal")
        return None

    def _watch(self, mine: OwnedGoal, timeout: float, should_stop: ShouldStop) -> ActionEnd | None:
        """Wait for the result: None once it is there, otherwise the reason to cancel the goal.

        Raises:
            PortError: when the clock jumped.
        """
        began, server_seen_at = self._now(), time.monotonic()
        deadline, looked_at = began + timeout, server_seen_at
        source = self._node.get_clock()
        simulated = isinstance(source, ROSClock) and bool(source.ros_time_is_active)
        clock = ClockWatch(began, server_seen_at, simulated)
        while not mine.ended.wait(_POLL):
            self._pulse.beat()
            if should_stop():
                return ActionEnd(MotionStatus.CANCELLED, message="stopped on request")
            now, wall = self._now(), time.monotonic()
            if clock.look(now, wall) < 0.0:  # the clock was corrected: what is left of the time begins anew
                deadline = now + timeout
            if now > deadline:
                return ActionEnd(MotionStatus.TIMED_OUT, message=f"{self._name} took more than {timeout:.1f} s")
            if clock.stood_for(wall) > _STANDSTILL:
                return ActionEnd(MotionStatus.TIMED_OUT, message="the clock stands still")
            if wall - looked_at > _CHECK_SERVER:
                looked_at = wall
                server_seen_at = wall if self.is_ready() else server_seen_at
                if wall - server_seen_at > 1.0:
                    return ActionEnd(MotionStatus.UNAVAILABLE, message=f"{self._name} went away")
        return None

    def _withdraw(self, mine: OwnedGoal) -> bool:
        """Cancel the goal, and every goal where that one's end is not confirmed; return whether it has ended.

        After _GRACE the signs of work end, so that guard and driver stop the arm where the cancel is lost. They wait
        for another 0.2 s by themselves, and by then an arm that heard the cancel has stopped.
        """
        began = time.monotonic()
        for cancel in (mine.cancel, self.cancel_all):
            cancel()
            deadline = time.monotonic() + _CANCEL_TIME
            while time.monotonic() < deadline:
                if mine.ended.wait(_POLL):
                    return True
                if time.monotonic() - began > _GRACE:
                    self._pulse.lapse()
        return False

    @staticmethod
    def _ended(mine: OwnedGoal) -> ActionEnd:
        statuses = {
            GoalStatus.STATUS_SUCCEEDED: MotionStatus.SUCCEEDED,
            GoalStatus.STATUS_CANCELED: MotionStatus.CANCELLED,
        }
        return ActionEnd(statuses.get(mine.answer.status, MotionStatus.ABORTED), mine.answer.result)

    def _post(self, function: Callable[[], object]) -> None:
        """Call a function in the thread that spins the node."""
        if self._node.executor is None:  # nothing spins: nobody answers either
            function()
        else:
            self._node.executor.create_task(function)


def cancel_service(action: str) -> str:
    """Return the name of an action's cancel service; a zero id cancels all of its goals."""
    return f"{action}/_action/cancel_goal"
