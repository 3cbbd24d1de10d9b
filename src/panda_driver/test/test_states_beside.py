"""Joint states are published beside the arm's thread, which waits for nobody."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_franka import ARM

from panda_driver.ports import ArmState

pytest.importorskip("rclpy")
from panda_driver import node_states
from panda_driver.node_states import StatePublisher


class SlowNode:
    """Its publisher holds whoever publishes until it is let go, and fails first if it is told so."""

    def __init__(self) -> None:
        self.free, self.sent, self.fails, self.reads = threading.Event(), list[Any](), 0, 0

    def create_publisher(self, *given: object) -> SimpleNamespace:
        return SimpleNamespace(publish=self._publish)

    def _publish(self, message: object) -> None:
        self.free.wait(10.0)
        if self.fails:
            self.fails -= 1
            raise RuntimeError("the context is invalid")
        self.sent.append(message)

    def get_clock(self) -> SimpleNamespace:
        return SimpleNamespace(now=self._now)

    def _now(self) -> SimpleNamespace:
        self.reads += 1
        if self.reads % 3 == 1:
            time.sleep(0.02)  # something else runs
        return SimpleNamespace(nanoseconds=time.time_ns())

    def get_logger(self) -> SimpleNamespace:
        return SimpleNamespace(error=lambda words: None, warning=lambda words: None)


def give(states: StatePublisher, count: int, first: int = 0) -> None:
    for n in range(first, first + count):
        rest = np.zeros(7)
        states.take(ArmState(time=0.01 * n, positions=rest + n, velocities=rest, efforts=rest, fault=""))
        time.sleep(0.002)


def test_the_arms_thread_does_not_wait_and_what_waits_is_bounded() -> None:
    node = SlowNode()
    states = StatePublisher(node, ARM, None, 1000.0, own_time=False)  # type: ignore[arg-type]
    began = time.monotonic()
    give(states, 60)
    assert time.monotonic() - began < 2.0, "the publisher held it up"
    node.free.set()
    states.stop_thread()
    assert 2 <= len(node.sent) <= node_states._MOST_WAITING + 1
    assert node.sent[0].position[0] < node.sent[-1].position[0]


def test_a_message_that_cannot_be_sent_does_not_end_the_others() -> None:
    node = SlowNode()
    node.fails = 1
    node.free.set()
    states = StatePublisher(node, ARM, None, 1000.0, own_time=False)  # type: ignore[arg-type]
    give(states, 5)
    states.stop_thread()
    assert 1 <= len(node.sent) <= 4


def test_stamps_are_of_the_measurement_whatever_runs_in_between() -> None:
    """A stamp was later than the next one where the thread was held up between the reading of two clocks."""
    node = SlowNode()
    node.free.set()
    states = StatePublisher(node, ARM, None, 1000.0, own_time=False)  # type: ignore[arg-type]
    began = time.time()
    give(states, 12)
    ended = time.time()
    states.stop_thread()
    stamps = [message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec for message in node.sent]
    assert len(stamps) > 2 and all(np.diff(stamps) > 0.0)
    assert began - 0.001 < stamps[0] and stamps[-1] < ended + 0.001
