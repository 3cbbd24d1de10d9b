"""A subscription that hears its publishers also where Fast DDS has lost the way to it.

Fast DDS names shared memory by port number. A process that takes the number of one which has just ended is now and then
sent nothing for as long as it lives. A second participant has another number, so that its subscription is heard.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

PATIENCE = 4.0  # s of silence with a publisher there before a second participant listens too
POLL_PERIOD = 0.05  # s


class Listener:
    """Subscribes in a node, and in a second participant when nothing comes. Only the first to hear is listened to."""

    def __init__(
        self,
        node: Node,
        message_class: Any,
        topic: str,
        callback: Callable[[Any], None],
        profile: QoSProfile,
        raw: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._node, self._topic, self._callback, self._clock = node, topic, callback, clock
        self._subscribe_in = lambda where, hear: where.create_subscription(message_class, topic, hear, profile, raw=raw)
        self._second: Node | None = None
        self._heard: Node | None = None
        self._silent_since: float | None = None
        self._subscribe(node)

    def spin_until(self, condition: Callable[[], bool]) -> None:
        """Listen until the condition holds."""
        import rclpy

        try:
            while not condition():
                rclpy.spin_once(self._node, timeout_sec=POLL_PERIOD)
                if self._second is not None:
                    self._executor.spin_once(timeout_sec=POLL_PERIOD)
                elif self._is_deaf():
                    self._open_second()
        finally:
            self._close_second()

    def _subscribe(self, where: Node) -> None:
        def hear(message: Any) -> None:
            self._heard = self._heard or where
            if self._heard is where:
                self._callback(message)

        self._subscribe_in(where, hear)

    def _is_deaf(self) -> bool:
        """Return True once a publisher was there for PATIENCE seconds and nothing came."""
        if self._heard is not None or not self._node.count_publishers(self._topic):
            self._silent_since = None
            return False
        now = self._clock()
        if self._silent_since is None:
            self._silent_since = now
        return now - self._silent_since >= PATIENCE

    def _open_second(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._second = rclpy.create_node(
            f"{self._node.get_name()}_again", context=self._context, start_parameter_services=False
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._second)
        self._subscribe(self._second)

    def _close_second(self) -> None:
        if self._second is not None:
            self._executor.shutdown()
            self._second.destroy_node()
            self._context.try_shutdown()
            self._second = None
