"""One goal at an action server, owned from being sent to its end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionClient
from rclpy.task import Future

Post = Callable[[Callable[[], None]], None]


class OwnedGoal:
    """A goal that is sent at once. Everything about it happens in the node's thread, its waits in the caller's.

    Called from another thread, rclpy may meet an answer before it knows of the question, and drop it.

    Args:
        post: calls a function in the node's thread.
    """

    def __init__(self, client: ActionClient, message: Any, post: Post) -> None:
        self._client, self._message, self._post = client, message, post
        self._handle: Any = None
        self._unwanted = False
        self.accepted: bool | None = None
        self.answer: Any = None
        self.ended = threading.Event()
        post(self._send)

    def cancel(self) -> None:
        """Cancel the goal now or, where it is not accepted yet, as soon as it is."""
        self._unwanted = True
        self._post(self._cancel)

    def _send(self) -> None:
        if self._unwanted:  # given up before it was sent: it is over, and there is nothing to cancel
            self.accepted = False
            self.ended.set()
            return
        self._client.send_goal_async(self._message).add_done_callback(self._on_response)

    def _cancel(self) -> None:
        if self._handle is not None and not self.ended.is_set():
            self._handle.cancel_goal_async()

    def _on_response(self, future: Future) -> None:
        handle = future.result()
        if handle is None or not handle.accepted:
            self.accepted = False
            self.ended.set()
            return
        self._handle = handle
        self.accepted = True
        handle.get_result_async().add_done_callback(self._on_result)
        if self._unwanted:
            handle.cancel_goal_async()

    def _on_result(self, future: Future) -> None:
        self.answer = future.result()
        self.ended.set()
