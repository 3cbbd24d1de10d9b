"""Calls of an action server that the test plays: what is cancelled, when, and what is said of it."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import pytest
import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from ros_domain import next_domain

from panda_executor import action_call
from panda_executor.action_call import ActionCaller, ActionEnd
from panda_executor.errors import PortError
from panda_executor.ports import MotionStatus
from panda_executor.work_pulse import WorkPulse

GUARD = 20.0  # s, after which a test gives up; nothing is measured by it
NAME = "/arm/follow"


class Arm:
    """An action server that decides and moves when the test lets it."""

    def __init__(self, node: Node, group: ReentrantCallbackGroup) -> None:
        self.may_answer, self.accepts, self.heeds_cancel = threading.Event(), True, True
        self.asked, self.executing = threading.Event(), threading.Event()
        self.cancelled, self.may_end = threading.Event(), threading.Event()
        self.may_answer.set()
        self.goals = 0
        self.server = ActionServer(
            node, FollowJointTrajectory, NAME, self._execute, callback_group=group,
            goal_callback=self._on_goal, cancel_callback=self._on_cancel,
        )  # fmt: skip

    def _on_goal(self, _: Any) -> GoalResponse:
        self.asked.set()
        self.may_answer.wait(GUARD)
        return GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT

    def _on_cancel(self, _: Any) -> CancelResponse:
        if not self.heeds_cancel:
            return CancelResponse.REJECT
        self.cancelled.set()
        self.may_end.set()
        return CancelResponse.ACCEPT

    def _execute(self, handle: Any) -> FollowJointTrajectory.Result:
        self.goals += 1
        self.executing.set()
        self.may_end.wait(GUARD)
        if self.cancelled.is_set():
            while not handle.is_cancel_requested:
                threading.Event().wait(0.01)
            handle.canceled()
        else:
            handle.succeed()
        return FollowJointTrajectory.Result(error_string="the arm's words")


class Bench:
    """A caller and its server in one process; calls run in a thread, as the executor's do."""

    def __init__(self) -> None:
        rclpy.init(domain_id=next_domain())
        self.node, group = Node("tester"), ReentrantCallbackGroup()
        self.arm = Arm(self.node, group)
        self.pulse = WorkPulse(time.monotonic, 0.0)  # alive while nothing runs
        self.caller = ActionCaller(self.node, FollowJointTrajectory, NAME, group, self.pulse)
        self._executor = MultiThreadedExecutor(num_threads=4)
        self._executor.add_node(self.node)
        self._spinning = threading.Thread(target=self._executor.spin)
        self._spinning.start()
        self._threads = ThreadPoolExecutor(1)

    def call(self, should_stop: Callable[[], bool] = lambda: False, timeout: float = GUARD) -> Future[ActionEnd]:
        return self._threads.submit(self.caller.call, FollowJointTrajectory.Goal(), timeout, should_stop)

    def close(self) -> None:
        self.arm.may_answer.set()
        self.arm.may_end.set()
        self._threads.shutdown()
        self._executor.shutdown()
        self._spinning.join(GUARD)
        self.arm.server.destroy()
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()


def test_a_motion_that_is_not_stopped_ends_by_itself(bench: Bench) -> None:
    bench.arm.may_end.set()
    end = bench.call().result(GUARD)
    assert end.status is MotionStatus.SUCCEEDED and end.result.error_string == "the arm's words"
    assert bench.arm.goals == 1 and not bench.arm.cancelled.is_set()


def test_a_call_that_is_to_stop_sends_nothing(bench: Bench) -> None:
    assert bench.call(lambda: True).result(GUARD).status is MotionStatus.CANCELLED
    assert not bench.arm.goals


def test_a_stop_on_the_way_sends_a_cancel(bench: Bench) -> None:
    stop = threading.Event()
    call = bench.call(stop.is_set)
    assert bench.arm.executing.wait(GUARD)
    stop.set()
    assert bench.arm.cancelled.wait(GUARD), "the arm would move on"
    end = call.result(GUARD)
    assert (end.status, end.message) == (MotionStatus.CANCELLED, "stopped on request")
    assert bench.pulse.is_alive()


def test_a_motion_that_takes_too_long_is_cancelled(bench: Bench) -> None:
    end = bench.call(timeout=0.05).result(GUARD)
    assert bench.arm.cancelled.wait(GUARD)
    assert end.status is MotionStatus.TIMED_OUT and f"{NAME} took more than 0.1 s" in end.message


def test_a_clock_that_goes_on_does_not_stand_still(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_call, "_STANDSTILL", 0.0)
    looks = itertools.count()

    def look() -> bool:
        if bench.arm.executing.is_set() and next(looks) == 5:
            bench.arm.may_end.set()
        return False

    assert bench.call(look).result(GUARD).status is MotionStatus.SUCCEEDED


def test_a_goal_that_is_accepted_too_late_is_cancelled(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_call, "_ANSWER_TIME", 0.1)
    monkeypatch.setattr(action_call, "_CANCEL_TIME", 0.1)
    bench.arm.may_answer.clear()
    end = bench.call().result(GUARD)
    assert end.status is MotionStatus.UNAVAILABLE and not end.confirmed
    assert end.message == f"no answer from {NAME}; the cancel was not confirmed"
    bench.arm.may_answer.set()
    assert bench.arm.cancelled.wait(GUARD), "the arm would move although its caller has given up"


def test_a_goal_that_is_not_taken_is_said(bench: Bench) -> None:
    bench.arm.accepts = False
    end = bench.call().result(GUARD)
    assert (end.status, end.message) == (MotionStatus.REJECTED, f"{NAME} did not take the goal")


def test_a_watch_that_fails_sends_a_cancel(bench: Bench) -> None:
    """Finger states that are too old raise out of the watch: the arm must not go on without an owner."""

    def fail() -> bool:
        if bench.arm.executing.is_set():
            raise PortError("the position of joint 'panda_finger_joint1' is 0.6 s old")
        return False

    call = bench.call(fail)
    assert bench.arm.cancelled.wait(GUARD), "the arm would move on"
    with pytest.raises(PortError, match=r"0\.6 s old"):
        call.result(GUARD)


def test_a_stop_before_the_goal_is_taken_is_not_ignored(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_call, "_ANSWER_TIME", GUARD)
    monkeypatch.setattr(action_call, "_CANCEL_TIME", 0.1)
    bench.arm.may_answer.clear()
    stop = threading.Event()
    call = bench.call(stop.is_set)
    assert bench.arm.asked.wait(GUARD)
    stop.set()
    end = call.result(GUARD / 2)
    assert end.status is MotionStatus.CANCELLED and not end.confirmed
    bench.arm.may_answer.set()
    assert bench.arm.cancelled.wait(GUARD), "the goal would be executed although its caller has stopped"


def test_a_cancel_that_is_not_confirmed_is_said(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_call, "_CANCEL_TIME", 0.1)
    bench.arm.heeds_cancel = False
    stop = threading.Event()
    call = bench.call(stop.is_set)
    assert bench.arm.executing.wait(GUARD)
    stop.set()
    end = call.result(GUARD)
    assert (end.confirmed, end.message) == (False, "stopped on request; the cancel was not confirmed")
    assert not bench.pulse.is_alive(), "the guard would not hear that nobody watches the goal"
    bench.arm.heeds_cancel = True


def test_all_goals_are_cancelled_whoever_sent_them(bench: Bench) -> None:
    call = bench.call()
    assert bench.arm.executing.wait(GUARD)
    bench.caller.cancel_all()
    assert bench.arm.cancelled.wait(GUARD)
    assert call.result(GUARD).status is MotionStatus.CANCELLED


def test_what_is_owned_is_seen_to_be_watched(bench: Bench) -> None:
    beats, stop = threading.Event(), threading.Event()
    monkeypatched = bench.caller._pulse.beat

    def beat() -> None:
        monkeypatched()
        if bench.arm.executing.is_set():
            beats.set()

    bench.caller._pulse.beat = beat  # type: ignore[method-assign]
    call = bench.call(stop.is_set)
    assert beats.wait(GUARD)
    stop.set()
    call.result(GUARD)
