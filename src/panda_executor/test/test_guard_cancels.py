"""The guard's and the hand's nodes, never started: what they hear, what they cancel, and what they publish."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cliport_interfaces.action")

import rclpy
from rclpy.clock_type import ClockType
from rclpy.parameter import Parameter
from ros_domain import next_domain
from sensor_msgs.msg import JointState

from cliport_core import topics
from cliport_core.messages import pose_from_transform_msg, stamp_from_msg, stamp_to_msg
from panda_executor.errors import ExecutorError
from panda_executor.guard import Fault, GuardConfig
from panda_executor.model import PandaModel
from panda_executor.node_guard import GuardNode
from panda_executor.node_hand_frame import HandFrameNode
from panda_model import load_preset

S = 1_000_000_000
PANDA = load_preset()
ARM = f"{PANDA.arm_action}/_action/cancel_goal"
GRIPPER = "/mine/_action/cancel_goal"


@pytest.fixture(scope="module", autouse=True)
def _ros() -> Iterator[None]:
    rclpy.init(domain_id=next_domain())
    yield
    rclpy.try_shutdown()


@pytest.fixture
def guard() -> Iterator[GuardNode]:
    node = GuardNode()
    yield node
    node.destroy_node()


def test_every_goal_is_cancelled_at_both_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    guard = GuardNode(parameter_overrides=[Parameter("gripper_action", value="/mine")])  # no franka_msgs
    assert list(guard._cancels) == [ARM, GRIPPER]
    said: list[str] = []
    monkeypatch.setattr(guard, "get_logger", lambda: SimpleNamespace(error=said.append))
    asked: list[tuple[str, bool]] = []
    there = {ARM, GRIPPER}

    def client(service: str) -> Any:
        def call_async(request: Any) -> None:
            whole = stamp_from_msg(request.goal_info.stamp) == 0 and not any(request.goal_info.goal_id.uuid)
            asked.append((service, whole))

        return SimpleNamespace(service_is_ready=lambda: service in there, call_async=call_async)

    monkeypatch.setattr(guard, "_cancels", {service: client(service) for service in (ARM, GRIPPER)})
    monkeypatch.setattr(guard._guard, "tick", lambda now: None)
    guard._tick()
    assert not asked and not said and guard._last is None
    monkeypatch.setattr(guard._guard, "tick", lambda now: Fault.JOINT_STATES_LOST)
    guard._tick()
    assert asked == [(ARM, True), (GRIPPER, True)] and guard._last is Fault.JOINT_STATES_LOST
    lost = "the joint states ended while the arm moved"
    assert said == [f"{lost}: all goals are cancelled at the controllers"]
    there.remove(ARM)
    guard._tick()
    assert asked[2:] == [(GRIPPER, True)], "one that is missing keeps no other from being told"
    assert said[1:] == [f"{lost}: cannot cancel at {ARM}: no such service; use the arm's own stop"]
    guard.destroy_node()


def test_all_that_moves_the_fingers_is_cancelled(guard: GuardNode) -> None:
    assert list(guard._cancels) == [f"{action}/_action/cancel_goal" for action in PANDA.motion_actions]
    assert len(guard._cancels) == 5


def test_joint_states_come_with_their_age(guard: GuardNode, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=10 * S))
    monkeypatch.setattr(guard, "get_clock", lambda: clock)
    heard: list[Any] = []
    monkeypatch.setattr(guard._guard, "on_joints", lambda *given: heard.append(given))
    message = JointState(name=["a", "b"], position=[0.25, 0.5])
    for stamp_ns in (9 * S + S // 2, 12 * S):
        message.header.stamp = stamp_to_msg(stamp_ns)
        guard._on_joints(message)
    assert [(list(names), list(positions)) for names, positions, _ in heard] == [(["a", "b"], [0.25, 0.5])] * 2
    assert [age for *_, age in heard] == pytest.approx([0.5, -2.0])


def test_what_it_listens_to_and_how_often_it_looks(guard: GuardNode) -> None:
    ours = {subscription.topic_name: subscription for subscription in guard.subscriptions}
    assert {topics.HEARTBEAT, topics.JOINT_STATES} <= set(ours)
    beats = guard._guard
    assert not beats._heard
    ours[topics.HEARTBEAT].callback(None)
    assert beats._heard and beats._since_beat == 0.0
    timers = {timer.callback: timer for timer in guard.timers}
    periods = {call.__name__: timer.timer_period_ns for call, timer in timers.items() if call is not None}
    assert periods == {"_tick": S // 50, "_report": S}
    assert {timer.clock.clock_type for timer in guard.timers} == {ClockType.STEADY_TIME}
    assert guard._guard._period == 0.02 and guard._guard._arm_joints == frozenset(PANDA.arm_joints)
    assert guard._guard.config == GuardConfig()


def test_names_and_limits_of_its_own() -> None:
    settings = {"arm_action": "/other/arm", "gripper_action": "/other/hand", "max_ahead": 0.0, "arm_joints": ["x"]}
    node = GuardNode(parameter_overrides=[Parameter(name, value=value) for name, value in settings.items()])
    assert list(node._cancels) == ["/other/arm/_action/cancel_goal", "/other/hand/_action/cancel_goal"]
    assert node._guard.config.max_ahead == 0.0 and node._guard._arm_joints == {"x"}
    node.destroy_node()
    for name in ("silence", "joint_silence", "max_joint_age"):
        with pytest.raises(ExecutorError, match=f"{name} must be positive, got 0"):
            GuardNode(parameter_overrides=[Parameter(name, value=0.0)])


def test_the_tick_and_the_report_are_of_now(guard: GuardNode, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("panda_executor.node_guard.time", SimpleNamespace(monotonic=lambda: 77.0))
    ticks: list[float] = []
    monkeypatch.setattr(guard._guard, "tick", ticks.append)
    guard._tick()
    assert ticks == [77.0]
    sent: list[Any] = []
    monkeypatch.setattr(guard, "_diagnostics", SimpleNamespace(publish=sent.append))
    guard._report()
    [status] = sent[0].status
    assert (status.name, status.hardware_id) == ("panda_guard: arm", "arm")


def test_the_hand_is_published_once_for_each_new_stamp_of_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    overrides = [Parameter("base_frame", value="world")]
    node = HandFrameNode(parameter_overrides=overrides)
    sent: list[Any] = []
    monkeypatch.setattr(node, "_transforms", SimpleNamespace(publish=sent.append))

    def hear(names: tuple[str, ...], positions: list[float], stamp_ns: int) -> list[int]:
        sent.clear()
        message = JointState(name=list(names), position=positions)
        message.header.stamp = stamp_to_msg(stamp_ns)
        node._on_joints(message)
        return [stamp_from_msg(link.header.stamp) for message in sent for link in message.transforms]

    ready = [float(position) for position in PANDA.ready]
    assert hear(PANDA.arm_joints[:6], ready[:6], 7 * S) == [], "one joint was never seen"
    assert hear(PANDA.arm_joints[6:], ready[6:], 7 * S + S // 10) == [7 * S]
    link = sent[0].transforms[0]
    assert (link.header.frame_id, link.child_frame_id) == ("world", PANDA.tcp_frame)
    wanted = PandaModel(PANDA).tcp_pose(np.array(PANDA.ready))
    assert pose_from_transform_msg(link.transform).is_close(wanted, 1e-9)
    assert hear(PANDA.arm_joints, ready, 7 * S + S // 5) == [7 * S + S // 5]
    assert hear(PANDA.arm_joints, ready, 7 * S + S // 5) == [], "said already"
    assert hear(PANDA.arm_joints[:1], ready[:1], 9 * S) == [], "stamped too far apart from the others"
    assert hear(PANDA.arm_joints, ready, 9 * S) == [9 * S]
    assert {topics.JOINT_STATES} <= {subscription.topic_name for subscription in node.subscriptions}
    node.destroy_node()
