"""The hand's motions in a calibration over ROS: goals to the executor, its answers, and options that go together."""

from __future__ import annotations

import threading
import time
from argparse import Namespace
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.action import CancelResponse, GoalResponse
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros_domain import next_domain
from std_msgs.msg import Empty, String

from cliport_core import topics
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import Pose
from cliport_core.ros_action_server import ThreadedActionServer
from cliport_interfaces.action import MoveHand
from cliport_perception.calibration import ros_mover
from cliport_perception.calibration.ros_mover import HandMover
from cliport_perception.calibration.ros_moving import check_moving
from cliport_perception.errors import CalibrationError

TARGET = Pose.from_xyz_rpy((0.4, 0.1, 0.5), (3.0, 0.2, 0.1))


class Executor:
    """The executor's action, played: it keeps its goals, and does with each what the test sets."""

    def __init__(self, node: Node) -> None:
        self.goals: list[Any] = []
        self.beats: list[str] = []
        self.accepts = True
        self.act: Callable[[Any], MoveHand.Result] = self.succeed
        node.create_subscription(String, topics.OWNER_HEARTBEAT, lambda message: self.beats.append(message.data), 10)
        beats = node.create_publisher(Empty, topics.HEARTBEAT, 10)
        self.lives = True
        node.create_timer(0.05, lambda: beats.publish(Empty()) if self.lives else None)
        self._server = ThreadedActionServer(
            node, MoveHand, topics.MOVE_HAND, self._execute, cancel_callback=lambda _: CancelResponse.ACCEPT,
            goal_callback=lambda _: GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT,
        )  # fmt: skip

    def _execute(self, handle: Any) -> MoveHand.Result:
        self.goals.append(handle.request)
        return self.act(handle)

    @staticmethod
    def succeed(handle: Any) -> MoveHand.Result:
        handle.succeed()
        return MoveHand.Result(outcome=int(Outcome.SUCCEEDED), message="the hand is there")


class Bench:
    """A mover and a played executor in one graph."""

    def __init__(self) -> None:
        self.node, self.other = rclpy.create_node("calibrate"), rclpy.create_node("executor")
        self.said: list[str] = []
        self.mover = HandMover(self.node, "panda_link0", 0.16, self.said.append)
        self._spinner = SingleThreadedExecutor()
        for node in (self.node, self.other):
            self._spinner.add_node(node)

    def until(self, condition: Callable[[], bool]) -> bool:
        deadline = time.monotonic() + 20.0
        while not condition() and time.monotonic() < deadline:
            self._spinner.spin_once(timeout_sec=0.05)
        return condition()

    def move(self) -> ActionResult:
        self.mover.start(TARGET)
        ends: list[ActionResult] = []

        def ended() -> bool:
            end = self.mover.end()
            if end is not None:
                ends.append(end)
            return bool(ends)

        assert self.until(ended)
        assert self.mover.end() is None, "an end is told once"
        return ends[0]

    def close(self) -> None:
        self.mover.close()
        self._spinner.shutdown()
        self.node.destroy_node()
        self.other.destroy_node()


@pytest.fixture
def bench() -> Iterator[Bench]:
    rclpy.init(domain_id=next_domain())
    made = Bench()
    yield made
    made.close()
    rclpy.try_shutdown()


def test_without_an_executor_that_is_said(bench: Bench) -> None:
    end = bench.move()
    assert end.outcome is Outcome.REJECTED and "the executor is not there" in end.message


def test_goals_are_owned_and_blind_and_their_ends_come_back(bench: Bench) -> None:
    executor = Executor(bench.other)
    assert bench.until(lambda: bool(bench.mover._action.server_is_ready()))
    assert bench.move() == ActionResult(Outcome.SUCCEEDED, "the hand is there", refusal_value=0.0, refusal_limit=0.0)
    goal = executor.goals[0]
    assert (goal.header.frame_id, goal.carried, goal.blind, goal.plan_only) == ("panda_link0", 0.16, True, False)
    assert np.allclose([goal.target.position.x, goal.target.position.z], [0.4, 0.5])
    assert bench.until(lambda: goal.owner in executor.beats) and goal.owner

    def fail(handle: Any) -> MoveHand.Result:
        handle.abort()
        return MoveHand.Result(outcome=int(Outcome.PLANNING_FAILED), message="no way")

    executor.act = fail
    assert (bench.move().outcome, bench.move().message) == (Outcome.PLANNING_FAILED, "no way")
    executor.accepts = False
    refused = bench.move()
    assert refused.outcome is Outcome.REJECTED and "busy, or stopped" in refused.message


def test_a_plan_that_waits_is_said_with_the_call_that_approves_it(bench: Bench) -> None:
    executor = Executor(bench.other)
    assert bench.until(lambda: bool(bench.mover._action.server_is_ready()))

    def wait(handle: Any) -> MoveHand.Result:
        for phase, name in ((0, "VALIDATING"), (11, "APPROVAL"), (11, "APPROVAL"), (6, "CARRY")):
            handle.publish_feedback(MoveHand.Feedback(phase=phase, phase_name=name, plan_id="1a2b"))
        deadline = time.monotonic() + 20.0
        while not bench.said and time.monotonic() < deadline:
            time.sleep(0.01)
        return Executor.succeed(handle)

    executor.act = wait
    assert bench.move().outcome is Outcome.SUCCEEDED
    assert bench.said == [
        "the hand's next motion waits for your approval: ros2 service call /panda_executor/approve "
        "cliport_interfaces/srv/ApprovePlan \"{plan_id: '1a2b'}\""
    ]


def test_an_executor_that_falls_silent_is_given_up(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed or hung in mid-motion, it never says how that ended; its motion is cancelled, should it come back."""
    monkeypatch.setattr(ros_mover, "_SILENT", 0.5)
    executor = Executor(bench.other)
    assert bench.until(lambda: bool(bench.mover._action.server_is_ready()))
    cancelled, left = threading.Event(), threading.Event()

    def hang(handle: Any) -> MoveHand.Result:
        executor.lives = False
        while not (handle.is_cancel_requested or left.is_set()):
            time.sleep(0.01)
        cancelled.set()
        handle.abort()
        return MoveHand.Result(message="late")

    executor.act = hang
    end = bench.move()
    assert end.outcome is Outcome.EXECUTION_FAILED and "no sign of life for 0.5 s" in end.message
    assert bench.until(cancelled.is_set), "its goal was left to itself"
    executor.lives, executor.act = True, Executor.succeed
    assert bench.move().message == "the hand is there", "the end of the one before is not that of the next"
    left.set()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"first": [0.0] * 6}, "--first and --carried belong to --move"),
        ({"carried": 0.2}, "--first and --carried belong to --move"),
        ({"move": True, "board_at": [0.0] * 6}, "leave --board-at and --touched away"),
        ({"move": True, "touched": [0.0] * 9}, "leave --board-at and --touched away"),
        ({"move": True, "carried": 0.0}, "--carried must be a length above zero"),
    ],
)
def test_options_that_do_not_go_together_are_refused(options: dict[str, Any], words: str) -> None:
    nothing = {"move": False, "first": None, "carried": None, "board_at": None, "touched": None}
    with pytest.raises(CalibrationError, match=words):
        check_moving(Namespace(**(nothing | options)))
    check_moving(Namespace(**nothing))
    check_moving(Namespace(**(nothing | {"move": True, "first": [0.0] * 6, "carried": 0.2})))
