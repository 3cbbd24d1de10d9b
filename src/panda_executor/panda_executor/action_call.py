"""One goal of an action, from sending to result, as a call that blocks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from panda_executor.ports import MotionStatus, ShouldStop

_POLL = 0.01  # between two looks at should_stop [s]
_ANSWER_TIME = 3.0  # for the server's answer to a goal or a cancel, wall clock [s]
_STANDSTILL = 5.0  # ROS time that does not move for so long, wall clock, will not move again [s]
_CHECK_SERVER = 0.25  # between two looks for the server, wall clock [s]


@dataclass(frozen=True)
class ActionEnd:
    """The end of a goal; `result` is the action's result message when there is one."""

    status: MotionStatus
    result: Any = None
    message: str = ""


class ActionCaller:
    """Sends goals to one action server, one at a time.

    Must be called from a thread other than those that the client's callbacks need.
    """

    def __init__(self, node: Node, action_type: Any, name: str, group: CallbackGroup) -> None:
        self._name = name
        self._client = ActionClient(node, action_type, name, callback_group=group)
        self._now: Callable[[], float] = lambda: node.get_clock().now().nanoseconds * 1e-9

    def is_ready(self) -> bool:
        """Return True if the server is there."""
        return bool(self._client.server_is_ready())

    def call(self, goal: Any, timeout: float, should_stop: ShouldStop) -> ActionEnd:
        """Send a goal and wait for its end. When should_stop turns true or time runs out, the goal is cancelled first.

        Args:
            timeout: of the motion, in ROS time [s]. A clock that stands still ends the wait, too.
        """
        if not self._client.wait_for_server(timeout_sec=1.0):
            return ActionEnd(MotionStatus.UNAVAILABLE, message=f"no action server at {self._name}")
        if should_stop():
            return ActionEnd(MotionStatus.CANCELLED, message="stopped before it was sent")
        sent = self._client.send_goal_async(goal)
        handle = self._wait(sent, _ANSWER_TIME)
        if handle is None:
            # It may yet be taken: whoever takes it is told to drop it.
            sent.add_done_callback(_cancel_late)
            return ActionEnd(MotionStatus.UNAVAILABLE, message=f"no answer from {self._name}")
        if not handle.accepted:
            return ActionEnd(MotionStatus.REJECTED, message=f"{self._name} did not take the goal")
        future = handle.get_result_async()
        cause = self._watch(future, timeout, should_stop)
        if cause is None:
            return self._ended(future.result())
        return self._cancelled(handle, future, cause)

    def _watch(self, future: Future, timeout: float, should_stop: ShouldStop) -> ActionEnd | None:
        """Wait for the result: None once it is there, otherwise the reason to cancel the goal."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        deadline = self._now() + timeout
        last, moved_at = self._now(), time.monotonic()
        server_seen_at = looked_at = time.monotonic()
        while not done.wait(_POLL):
            if should_stop():
                return ActionEnd(MotionStatus.CANCELLED, message="stopped on request")
            now, wall = self._now(), time.monotonic()
            if now != last:
                last, moved_at = now, wall
            if now > deadline:
                return ActionEnd(MotionStatus.TIMED_OUT, message=f"{self._name} took more than {timeout:.1f} s")
            if wall - moved_at > _STANDSTILL:
                return ActionEnd(MotionStatus.TIMED_OUT, message="the clock stands still")
            if wall - looked_at > _CHECK_SERVER:
                looked_at = wall
                server_seen_at = wall if self.is_ready() else server_seen_at
                if wall - server_seen_at > 1.0:
                    return ActionEnd(MotionStatus.UNAVAILABLE, message=f"{self._name} went away")
        return None

    def _cancelled(self, handle: Any, future: Future, cause: ActionEnd) -> ActionEnd:
        """Cancel, wait until the server has ended the goal, and report the cause."""
        handle.cancel_goal_async()
        answer = self._wait(future, 1.0)
        if answer is None:
            return ActionEnd(cause.status, message=f"{cause.message}; the cancel was not confirmed")
        return ActionEnd(cause.status, answer.result, cause.message)

    @staticmethod
    def _ended(answer: Any) -> ActionEnd:
        statuses = {
            GoalStatus.STATUS_SUCCEEDED: MotionStatus.SUCCEEDED,
            GoalStatus.STATUS_CANCELED: MotionStatus.CANCELLED,
        }
        return ActionEnd(statuses.get(answer.status, MotionStatus.ABORTED), answer.result)

    @staticmethod
    def _wait(future: Future, seconds: float) -> Any | None:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        return future.result() if done.wait(seconds) else None


def _cancel_late(future: Future) -> None:
    handle = future.result()
    if handle is not None and handle.accepted:
        handle.cancel_goal_async()
