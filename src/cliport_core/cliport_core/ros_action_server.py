"""An action server whose goals run in threads of their own; here because every node's package builds on this one."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import default_cancel_callback, default_goal_callback
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

Decide = Callable[[Any], Any]
_WALL_CLOCK = Clock(clock_type=ClockType.SYSTEM_TIME)  # never ends: rcl's timer of an action server points into it
RESULT_KEPT_S = 30  # rclpy's own 900 s are the goals of some 200 scenes, all of them named in each status


class ThreadedActionServer(ActionServer):  # type: ignore[type-arg,unused-ignore]
    """Lets a node with long goals be spun by one thread, which stays free to hear a cancel.

    rclpy runs a goal inside the executor, so that only a MultiThreadedExecutor could hear one; that executor costs
    most of a core at a few dozen messages a second, and starves what it shares the machine with.
    """

    def __init__(
        self,
        node: Node,
        *args: Any,
        goal_callback: Decide = default_goal_callback,
        cancel_callback: Decide = default_cancel_callback,
        **kwargs: Any,
    ) -> None:
        """Take rclpy's arguments; result_timeout: RESULT_KEPT_S [s] of wall time unless said.

        Where a callback fails, a goal is rejected or a cancel accepted; the log says so.
        """
        self._log = node.get_logger()
        goal = self._or(goal_callback, GoalResponse.REJECT)
        cancel = self._or(cancel_callback, CancelResponse.ACCEPT)
        kwargs = {"result_timeout": RESULT_KEPT_S} | kwargs
        super().__init__(_OnWallTime(node), *args, goal_callback=goal, cancel_callback=cancel, **kwargs)

    def _or(self, decide: Decide, otherwise: Any) -> Decide:
        def decided(asked: Any) -> Any:
            try:
                return decide(asked)
            except Exception as error:  # rclpy 7.1's events executor would end in a segmentation fault
                self._log.error(f"{otherwise.name} of a goal for {type(error).__name__}: {error}")
                return otherwise

        return decided

    def notify_execute(self, goal_handle: Any, execute_callback: Callable[[Any], Any] | None) -> None:
        """Run an accepted goal; called by rclpy."""
        callback = execute_callback or self._execute_callback

        def run() -> None:
            coroutine = self._execute_goal(callback, goal_handle)
            # A plain callback: the coroutine ends at its first step. A node that ends meanwhile takes the handle away.
            with contextlib.suppress(StopIteration, InvalidHandle):
                coroutine.send(None)

        threading.Thread(target=run, name="goal", daemon=True).start()


class _OnWallTime:
    """Shows an action server a node with a clock that no simulation sets: results are kept by it, and goals stamped.

    A simulated clock moves in steps. rcl's timer for the next result to be forgotten is due at a step, and the result
    may be forgotten only after it: until the next step the executor asks again and again, 3000 times a second, and
    hears little else where hundreds of goals are known. Goals are stamped in wall time so: a client that asks to cancel
    those before a simulated time cancels none; by its id a goal is cancelled, and all goals are, as ever.
    """

    def __init__(self, node: Node) -> None:
        self._node = node

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)

    def get_clock(self) -> Clock:
        return _WALL_CLOCK
