"""The thread that spins a node, with an executor that the test holds."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from cliport_core import ros_running
from cliport_core.ros_running import SpinThread


class HeldExecutor:
    """An executor in the middle of a callback, which ends a moment after it is woken."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.woken, self.shut_down, self.entered = threading.Event(), threading.Event(), threading.Event()
        self.ended_before_shutdown: bool | None = None
        self.callback_ended = False
        self.error: Exception | None = None

    def add_node(self, node: Any) -> None:
        self.nodes.append(node)

    def spin_once(self, timeout_sec: float) -> None:
        self.entered.set()
        if self.error is not None:
            raise self.error
        assert self.woken.wait(60.0)
        self.shut_down.wait(0.1)  # a shutdown in this time comes too early
        self.callback_ended = True

    def wake(self) -> None:
        self.woken.set()

    def shutdown(self, timeout_sec: float) -> None:
        self.ended_before_shutdown = self.callback_ended
        self.shut_down.set()


@pytest.fixture
def executor(monkeypatch: pytest.MonkeyPatch) -> HeldExecutor:
    held = HeldExecutor()
    monkeypatch.setattr(ros_running, "node_executor", lambda context: held)
    return held


def test_the_callback_in_hand_ends_before_the_executor_is_shut_down(executor: HeldExecutor) -> None:
    spinner = SpinThread("node", pytest.fail)  # type: ignore[arg-type]
    assert executor.entered.wait(60.0)
    spinner.stop()
    assert executor.nodes == ["node"]
    assert executor.ended_before_shutdown is True


def test_a_callbacks_exception_is_told(executor: HeldExecutor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "excepthook", lambda arguments: None)  # the thread dies of it, as it should
    executor.error = RuntimeError("a defect")
    told: list[BaseException] = []
    spinner = SpinThread("node", told.append)  # type: ignore[arg-type]
    spinner._thread.join(60.0)
    assert told == [executor.error]
