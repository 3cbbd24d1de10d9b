"""Calls handed to the thread that spins a node."""

from __future__ import annotations

from collections.abc import Callable
from queue import Empty, SimpleQueue

from rclpy.node import Node


class SpinQueue:
    """Runs what other threads post in the thread that spins the node: rclpy's clients are not safe between threads."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._posted: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def post(self, act: Callable[[], None]) -> None:
        """Have `act` run soon, after what was posted before it; before the node is spun it waits for `run`."""
        self._posted.put(act)
        executor = self._node.executor
        if executor is not None:
            executor.create_task(self.run)

    def run(self) -> None:
        """Run what is posted; to be called in the node's thread only."""
        while True:
            try:
                act = self._posted.get_nowait()
            except Empty:
                return
            act()
