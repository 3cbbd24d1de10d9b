"""The driver's node over an arm and a hand that do what they are told."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise

import pytest

pytest.importorskip("rclpy", exc_type=ImportError)

import rclpy
from fake_franka import ARM, FakeArm, FakeHand
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_domain import next_domain
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.errors import CoreError
from cliport_core.ros_running import SpinThread
from panda_driver.conformance.checks import CHECKS
from panda_driver.conformance.main import run_checks
from panda_driver.conformance.node_client import ArmClient
from panda_driver.conformance.plan import small_motion
from panda_driver.conformance.subject import Bounds, End
from panda_driver.errors import ConnectionFailedError, DriverError
from panda_driver.node import DriverNode
from sim_bridge.conversions import time_from_msg

WAIT = 30.0  # s, after which a test gives up; nothing is measured by it
# The fake arm's clock goes on by 10 ms with each of the loop's turns, however long these take.
BOUNDS = Bounds(rate=8.0, age=2.0, duration=3.0, patience=4.0, cancel=5.0)


def parameters(**given: object) -> list[Parameter]:
    return [Parameter(name, value=value) for name, value in {"robot_ip": "fake", **given}.items()]


class Bench:
    """The node, a client of it, and what it drives."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=next_domain())
        self.arm, self.hand, self.failures = FakeArm(), FakeHand(), list[BaseException]()
        self.node = DriverNode(
            self.failures.append, lambda _: (self.arm, lambda: self.hand), context=self.context,
            parameter_overrides=parameters(),
        )  # fmt: skip
        self.user = Node("user", context=self.context)
        self.client = ArmClient(self.user, ARM, BOUNDS)
        self.heart = self.user.create_publisher(Empty, topics.HEARTBEAT, 10)
        self.services = {
            name: self.user.create_client(Trigger, f"/panda_driver/{name}")
            for name in ("recover_errors", "home_gripper")
        }
        self.spinners = [SpinThread(node, self.failures.append, self.context) for node in (self.node, self.user)]
        assert not self.client.missing(WAIT, with_hand=True)

    def call(self, name: str) -> Trigger.Response:
        assert self.services[name].wait_for_service(WAIT)
        future = self.services[name].call_async(Trigger.Request())
        assert self.client.wait(future.done, WAIT)
        return future.result()

    def close(self) -> None:
        self.node.close()
        for spinner in self.spinners:
            spinner.stop()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.close()


def test_the_driver_conforms(bench: Bench) -> None:
    outcomes = run_checks(bench.client, CHECKS, lambda _: None)
    assert not [outcome for outcome in outcomes if not outcome.passed]
    assert not bench.failures


def test_a_goal_that_makes_no_sense_is_rejected_before_it_begins(bench: Bench) -> None:
    plan = small_motion(ARM.ready, ARM.limits, 0.05, 1.0)
    goals = [bench.client.follow(["somebody_elses", *ARM.arm_joints[1:]], plan), bench.client.grip(9.0, 20.0)]
    assert bench.client.wait(lambda: all(goal.end is not None for goal in goals), WAIT)
    assert [goal.end for goal in goals] == [End.REJECTED] * 2
    assert (bench.arm.begun, bench.hand.told) == (0, [])


def test_the_arms_own_time_is_the_graphs_where_that_is_asked_for() -> None:
    context = Context()
    rclpy.init(context=context, domain_id=next_domain())
    arm = FakeArm()
    node = DriverNode(
        lambda _: None, lambda _: (arm, None), context=context, parameter_overrides=parameters(publish_clock=True)
    )
    user = Node("user", context=context)
    clocks: list[float] = []
    stamps: list[float] = []
    user.create_subscription(
        ClockMessage, topics.CLOCK, lambda message: clocks.append(time_from_msg(message.clock)), 10
    )
    user.create_subscription(
        JointState, topics.JOINT_STATES, lambda message: stamps.append(time_from_msg(message.header.stamp)), 10
    )
    spinner = SpinThread(user, lambda _: None, context)
    for _ in range(int(WAIT / 0.01)):
        if len(clocks) > 5 and len(stamps) > 5:
            break
        time.sleep(0.01)
    node.close()
    spinner.stop()
    rclpy.try_shutdown(context=context)
    assert len(clocks) > 5 and len(stamps) > 5
    assert all(100.0 <= moment <= arm.time + 0.01 for moment in [*clocks, *stamps])


def test_a_lost_heartbeat_stops_the_arm(bench: Bench) -> None:
    plan = small_motion(ARM.ready, ARM.limits, 0.3, 600.0)
    beat = bench.user.create_timer(0.05, lambda: bench.heart.publish(Empty()))
    assert bench.client.wait(lambda: bench.node._watchdog._silence < 0.2, WAIT)
    goal = bench.client.follow(ARM.arm_joints, plan)
    assert bench.client.wait(lambda: bench.arm.in_control, WAIT)
    beat.cancel()
    assert bench.client.wait(lambda: goal.end is not None, WAIT)
    assert (goal.end, goal.words) == (End.ABORTED, "heartbeat lost: nothing from the executor for 0.2 s")
    assert bench.client.wait(lambda: not bench.arm.in_control, WAIT)


def test_a_reflex_is_told_and_cleared_by_the_service(bench: Bench) -> None:
    bench.arm.stops_with = "the arm stopped by itself: cartesian_reflex"
    goal = bench.client.follow(ARM.arm_joints, small_motion(ARM.ready, ARM.limits, 0.05, 2.0))
    assert bench.client.wait(lambda: goal.end is not None, WAIT)
    assert (goal.end, goal.words) == (End.ABORTED, "the arm stopped by itself: cartesian_reflex")
    bench.arm.keeps_errors = True
    assert (bench.call("recover_errors").success, bench.call("recover_errors").message) == (
        False, "the arm keeps its errors",
    )  # fmt: skip
    bench.arm.keeps_errors = False
    assert bench.call("recover_errors").success
    assert bench.call("home_gripper").success


def test_a_lost_hand_leaves_the_arm_driven(bench: Bench) -> None:
    seen: list[JointState] = []
    bench.user.create_subscription(JointState, topics.JOINT_STATES, seen.append, 10)
    assert bench.client.wait(lambda: bool(seen) and len(seen[-1].name) == 9, WAIT)

    def cut() -> None:
        raise ConnectionFailedError("the hand was lost")

    bench.hand.read = cut  # type: ignore[assignment]
    assert bench.client.wait(lambda: list(seen[-1].name) == list(ARM.arm_joints), WAIT)
    grip = bench.client.grip(0.01, 20.0)
    goal = bench.client.follow(ARM.arm_joints, small_motion(ARM.ready, ARM.limits, 0.05, 2.0))
    assert bench.client.wait(lambda: goal.end is not None and grip.end is not None, WAIT)
    assert (goal.end, grip.end, bench.failures) == (End.SUCCEEDED, End.REJECTED, [])
    assert bench.call("home_gripper").message == "the hand was lost"
    del bench.hand.read
    assert bench.call("home_gripper").success
    assert bench.client.wait(lambda: len(seen[-1].name) == 9, WAIT)


def test_a_state_whose_time_stands_still_is_published_once(bench: Bench) -> None:
    stamps: list[float] = []
    bench.user.create_subscription(
        JointState, topics.JOINT_STATES, lambda message: stamps.append(time_from_msg(message.header.stamp)), 10
    )
    assert bench.client.wait(lambda: len(stamps) > 5, WAIT)
    bench.arm.step = 0.0
    turns = bench.arm.readings
    assert bench.client.wait(lambda: bench.arm.readings > turns + 50, WAIT)
    count = len(stamps)
    assert bench.client.wait(lambda: bench.arm.readings > turns + 150, WAIT)
    assert len(stamps) == count
    assert all(later > earlier for earlier, later in pairwise(stamps))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"robot_ip": ""}, "robot_ip is empty"),
        ({"arm": "pr2"}, "unknown robot 'pr2'"),
        ({"torque_threshold": 0.0}, "torque_threshold must be in 1..100, got 0"),
        ({"stiffness": [1.0, 2.0]}, "stiffness must be 7 numbers"),
        ({"heartbeat_timeout": 0.0}, "heartbeat_timeout must be in 0.1..60"),
    ],
)
def test_bad_parameters_are_refused(given: dict[str, object], words: str) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=next_domain())

    def connect(_: object) -> tuple[FakeArm, None]:
        raise DriverError("connected too early")

    with pytest.raises(CoreError, match=words):
        DriverNode(lambda _: None, connect, context=context, parameter_overrides=parameters(**given))
    rclpy.try_shutdown(context=context)
