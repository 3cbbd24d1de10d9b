"""Spinning of nodes until something has come about."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

_PATIENCE, _PERIOD = 20.0, 0.05  # [s]


def until(nodes: Sequence[Node], condition: Callable[[], bool], act: Callable[[], None] = lambda: None) -> bool:
    """Spin nodes, and act again and again, until a condition holds; return whether it did in time."""
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    end, due = time.monotonic() + _PATIENCE, 0.0
    while time.monotonic() < end and not condition():
        if time.monotonic() > due:
            act()
            due = time.monotonic() + _PERIOD
        executor.spin_once(timeout_sec=0.02)
    executor.shutdown()
    return condition()
