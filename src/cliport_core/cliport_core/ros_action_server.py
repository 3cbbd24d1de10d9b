"""An action server whose goals run in threads of their own; here because every node's package builds on this one."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer
from rclpy.exceptions import InvalidHandle


class ThreadedActionServer(ActionServer):  # type: ignore[type-arg,unused-ignore]
    """Lets a node with long goals be spun by a SingleThreadedExecutor, which stays free to hear a cancel.

    rclpy runs a goal inside the executor, so that only a MultiThreadedExecutor could hear one; that executor costs
    most of a core at a few dozen messages a second, and starves what it shares the machine with.
    """

    def notify_execute(self, goal_handle: Any, execute_callback: Callable[[Any], Any] | None) -> None:
        """Run an accepted goal; called by rclpy."""
        callback = execute_callback or self._execute_callback

        def run() -> None:
            coroutine = self._execute_goal(callback, goal_handle)
            # A plain callback: the coroutine ends at its first step. A node that ends meanwhile takes the handle away.
            with contextlib.suppress(StopIteration, InvalidHandle):
                coroutine.send(None)

        threading.Thread(target=run, name="goal", daemon=True).start()
