"""Calls that other threads hand to the thread that spins a node."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import pytest

from cliport_core.ros_spin_queue import SpinQueue


class Tasks:
    """An executor that runs its tasks when the test says so."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []

    def create_task(self, act: Callable[[], None]) -> None:
        self.waiting.append(act)


@pytest.fixture
def node() -> SimpleNamespace:
    return SimpleNamespace(executor=Tasks())


def test_what_is_posted_runs_in_the_executor_and_in_order(node: SimpleNamespace) -> None:
    done: list[str] = []
    queue = SpinQueue(node)  # type: ignore[arg-type]
    queue.post(lambda: done.append("first"))
    queue.post(lambda: done.append("second"))
    assert done == []
    for task in node.executor.waiting:
        task()
    assert done == ["first", "second"]


def test_what_is_posted_before_the_node_is_spun_waits(node: SimpleNamespace) -> None:
    executor, node.executor = node.executor, None
    done: list[str] = []
    queue = SpinQueue(node)  # type: ignore[arg-type]
    queue.post(lambda: done.append("early"))
    assert done == []
    node.executor = executor
    queue.post(lambda: done.append("late"))
    assert len(executor.waiting) == 1
    executor.waiting[0]()
    assert done == ["early", "late"]


def test_what_fails_is_raised_and_the_rest_stays(node: SimpleNamespace) -> None:
    done: list[str] = []
    queue = SpinQueue(node)  # type: ignore[arg-type]
    queue.post(lambda: 1 / 0)  # type: ignore[arg-type, return-value]
    queue.post(lambda: done.append("after"))
    with pytest.raises(ZeroDivisionError):
        queue.run()
    queue.run()
    assert done == ["after"]
