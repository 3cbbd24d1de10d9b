"""The executor's node part by part, over a node that is never started: what it hears, offers, reports and ends."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cliport_interfaces.action")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from rclpy.action import CancelResponse, GoalResponse
from rclpy.clock_type import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage

from cliport_core.messages import pose_to_transform_msg, stamp_from_msg, stamp_to_msg
from cliport_core.pose import Pose
from cliport_interfaces.action import MoveHand, PickPlace
from panda_executor import node as node_module
from panda_executor import node_goals
from panda_executor.camera_place import CameraPlace
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.guard_watch import GuardWatch
from panda_executor.health import AgeLimits
from panda_executor.joint_tracker import JointTracker
from panda_executor.node import ExecutorNode
from panda_executor.node_goals import GoalServers
from panda_executor.owner_watch import OwnerWatch

S = 1_000_000_000
ARM = tuple(f"j{i}" for i in range(7))


class Bench:
    """A node without ROS whose time is 10 s, and all that it asks of ROS."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.words: list[str] = []
        self.subscriptions: dict[str, tuple[Any, Any, dict[str, Any]]] = {}
        self.timers: list[tuple[float, Any, dict[str, Any]]] = []
        self.published: list[Any] = []
        self.steady = 64.0
        node = self.node = ExecutorNode.__new__(ExecutorNode)
        logger = SimpleNamespace(warning=self.words.append)
        clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=10 * S))
        played: dict[str, Any] = {
            "get_logger": lambda: logger,
            "get_clock": lambda: clock,
            "create_subscription": self._subscribe,
            "create_timer": lambda period, call, **named: self.timers.append((period, call, named)),
            "create_publisher": lambda kind, topic, depth: SimpleNamespace(publish=self.published.append, topic=topic),
        }
        for name, value in played.items():
            monkeypatch.setattr(ExecutorNode, name, staticmethod(value))
        node.gate, node._joints, node._camera = Gate(), JointTracker(ARM, ("f",)), CameraPlace("base")
        node._owners = OwnerWatch(lambda: self.steady, 0.1)
        node._guard = GuardWatch(lambda: self.steady, 3.0)
        clouds: Any = SimpleNamespace(put=lambda raw: None, complain=None, age=lambda now_ns: 0.5)
        controllers: Any = SimpleNamespace(
            arm_ready=True, gripper_ready=True, stop=lambda: None,
            pulse=SimpleNamespace(turn="a turn", is_alive="alive"),
        )  # fmt: skip
        node._clouds, node._controllers = clouds, controllers
        node._limits = AgeLimits(0.5, 2.0, 0.25)
        node._calls = "calls"  # type: ignore[assignment]
        node._session = "the session"  # type: ignore[assignment]

    def _subscribe(self, kind: Any, topic: str, callback: Any, qos: Any, **named: Any) -> None:
        self.subscriptions[topic] = callback, qos, named


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_joint_states_and_signs_of_life_are_taken_note_of(bench: Bench) -> None:
    message = JointState(name=[*ARM, "f"], position=[0.1 * i for i in range(7)] + [0.02])
    message.header.stamp = stamp_to_msg(9 * S + S // 2)
    bench.node._on_joints(message)
    now = bench.node._now_ns()
    assert now == 10 * S and bench.node._joints.age(now) == pytest.approx(0.5)
    np.testing.assert_allclose(bench.node._joints.arm_positions(now), 0.1 * np.arange(7))
    bench.node._owners.begin("me")
    for _ in range(9):
        bench.steady += 0.05
        bench.node._on_owner(String(data="me"))
        assert not bench.node._owners.is_silent("me")


def test_what_perception_refuses_a_camera_for_reaches_the_clouds(bench: Bench) -> None:
    heard: list[tuple[str, int]] = []
    bench.node._settings = SimpleNamespace(cameras=1)  # type: ignore[assignment]
    bench.node._clouds.complain = lambda *given: heard.append(given)  # type: ignore[method-assign]
    bench.node._subscribe()
    statuses = [
        DiagnosticStatus(name="cliport_perception: camera", level=DiagnosticStatus.OK, message="fresh"),
        DiagnosticStatus(name="cliport_perception: camera 2", level=DiagnosticStatus.ERROR, message="it was moved"),
        DiagnosticStatus(name="cliport_perception: camera", level=DiagnosticStatus.STALE, message="late"),
        DiagnosticStatus(name="panda_executor: arm", level=DiagnosticStatus.ERROR, message="no arm"),
    ]
    bench.subscriptions["/diagnostics"][0](DiagnosticArray(header=Header(stamp=stamp_to_msg(7 * S)), status=statuses))
    assert heard == [("perception refuses the camera's data: it was moved", 7 * S)]


def test_the_guards_reports_are_its_signs_of_life(bench: Bench) -> None:
    for name, watches in (("panda_executor: arm", False), ("panda_guard: arm", True)):
        bench.node._on_report(DiagnosticArray(status=[DiagnosticStatus(name=name, level=DiagnosticStatus.WARN)]))
        with nullcontext() if watches else pytest.raises(RequestError, match="no guard has been heard yet"):
            bench.node._guard.check()


def test_the_camera_is_found_also_after_a_transform_that_is_none(bench: Bench) -> None:
    broken = TransformStamped(child_frame_id="broken")
    broken.transform.rotation.w = float("nan")
    link = TransformStamped(child_frame_id="lens", transform=pose_to_transform_msg(Pose(np.eye(3), np.arange(3.0))))
    link.header.frame_id = "base"
    bench.node._on_transforms(TFMessage(transforms=[broken, link]))
    assert len(bench.words) == 1 and bench.words[0].startswith("transform of 'broken' ignored: ")
    info = CameraInfo()
    info.header.frame_id = "lens"
    bench.node._on_camera_info(1, bytes(serialize_message(info)))
    np.testing.assert_array_equal(bench.node._camera.positions(), [np.arange(3.0)])


class Offered:
    """The servers of goals over a session that is played."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, bench: Bench) -> None:
        self.servers: dict[str, tuple[Any, dict[str, Any]]] = {}
        monkeypatch.setattr(node_goals, "ThreadedActionServer", self._serve)
        self.end: Any = lambda: None
        session: Any = SimpleNamespace(
            run=lambda handle, logger: self.ran("pick and place", handle, logger),
            move_hand=lambda handle, logger: self.ran("hand", handle, logger),
        )
        self.gate, group = bench.node.gate, "calls"
        self.made = GoalServers(bench.node, session, self.gate, group)  # type: ignore[arg-type]
        self.logger = bench.node.get_logger()

    def _serve(self, node: Any, kind: Any, name: str, execute: Any, **named: Any) -> None:
        self.servers[name] = execute, {"kind": kind, "node": node, **named}

    def ran(self, what: str, handle: Any, logger: Any) -> str:
        assert logger is self.logger
        self.end()
        return f"{what} of {handle}"


def test_both_kinds_of_goals_are_served(monkeypatch: pytest.MonkeyPatch, bench: Bench) -> None:
    offered = Offered(monkeypatch, bench)
    kinds = {name: named["kind"] for name, (_, named) in offered.servers.items()}
    assert kinds == {"/panda_executor/pick_place": PickPlace, "/panda_executor/move_hand": MoveHand}
    for _, named in offered.servers.values():
        assert named["node"] is bench.node and named["callback_group"] == "calls"
        assert named["cancel_callback"]("any") == CancelResponse.ACCEPT
    assert offered.servers["/panda_executor/pick_place"][0]("it") == "pick and place of it"
    assert offered.servers["/panda_executor/move_hand"][0]("it") == "hand of it"


@pytest.mark.parametrize("name", ["/panda_executor/pick_place", "/panda_executor/move_hand"])
def test_goals_go_through_the_gate(name: str, monkeypatch: pytest.MonkeyPatch, bench: Bench) -> None:
    offered = Offered(monkeypatch, bench)
    execute, named = offered.servers[name]
    others = [each["goal_callback"] for _, each in offered.servers.values()]
    assert named["goal_callback"]("goal") == GoalResponse.ACCEPT and bench.words == []
    assert offered.gate.busy
    assert [other("goal") for other in others] == [GoalResponse.REJECT] * 2, "one gate for both"
    assert bench.words == ["goal rejected: another goal is being executed"] * 2
    execute("the handle")
    assert not offered.gate.busy, "no other goal would ever run"

    def fail() -> None:
        raise RuntimeError

    offered.end = fail
    assert named["goal_callback"]("goal") == GoalResponse.ACCEPT
    with pytest.raises(RuntimeError):
        execute("the handle")
    assert not offered.gate.busy


@pytest.mark.parametrize(
    ("arm", "gripper", "busy", "words"),
    [
        (True, True, False, "ready"),
        (False, True, False, "the arm's action server is missing"),
        (True, False, False, "the gripper's action server is missing"),
        (True, True, True, "executing"),
    ],
)
def test_the_report_is_of_now(bench: Bench, arm: bool, gripper: bool, busy: bool, words: str) -> None:
    node = bench.node
    node._diagnostics = SimpleNamespace(publish=bench.published.append)  # type: ignore[assignment]
    node._runner = SimpleNamespace(held_width=lambda: 0.04)  # type: ignore[assignment]
    node._controllers.arm_ready, node._controllers.gripper_ready = arm, gripper  # type: ignore[misc]
    node._joints.update((*ARM, "f"), [0.0] * 8, 10 * S - S // 4)
    if busy:
        node.gate.enter()
    node._report()
    [message] = bench.published
    assert stamp_from_msg(message.header.stamp) == 10 * S
    assert message.status[0].message == words
    values = {value.key: value.value for value in message.status[0].values}
    assert (values["joint state age [s]"], values["cloud age [s]"]) == ("0.25", "0.50")
    assert values["held width [m]"] == "0.040"


def test_what_is_heard_and_how(bench: Bench) -> None:
    node = bench.node
    node._settings = SimpleNamespace(cameras=2)  # type: ignore[assignment]
    node._subscribe()
    heard = {topic: callback for topic, (callback, _, _) in bench.subscriptions.items()}
    for topic in [topic for topic in heard if topic.endswith("camera_info")]:
        call = heard.pop(topic)
        assert (call.func, call.args) == (node._on_camera_info, (2 if "camera2" in topic else 1,))
    assert heard == {
        "/cliport/points": node._clouds.put,
        "/joint_states": node._on_joints,
        "/cliport/owner_heartbeat": node._on_owner,
        "/diagnostics": node._on_report,
        "/tf_static": node._on_transforms,
    }
    qos = {topic: qos for topic, (_, qos, _) in bench.subscriptions.items()}
    assert (qos["/cliport/points"].depth, qos["/cliport/points"].reliability) == (1, QoSProfile(depth=1).reliability)
    for name in ("/joint_states", "/camera/color/camera_info"):
        assert qos[name].reliability == ReliabilityPolicy.BEST_EFFORT
    assert qos["/tf_static"].durability == DurabilityPolicy.TRANSIENT_LOCAL and qos["/tf_static"].depth == 100
    assert qos["/cliport/owner_heartbeat"] == qos["/diagnostics"] == 20
    raw = {topic for topic, (_, _, named) in bench.subscriptions.items() if named.get("raw")}
    assert raw == {"/cliport/points", "/camera/color/camera_info", "/camera2/color/camera_info"}
    groups = {topic: named["callback_group"] for topic, (_, _, named) in bench.subscriptions.items()}
    assert len({id(group) for group in groups.values()}) == 2 and None not in groups.values()
    assert groups["/cliport/points"] is not groups["/joint_states"], "a cloud of 16 MB must hold up no joint state"


def test_what_is_offered_and_how_often(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    node, made = bench.node, dict[str, Any]()
    monkeypatch.setattr(node_module, "Surroundings", lambda *given: made.setdefault("surroundings", given))
    monkeypatch.setattr(node_module, "PersonServices", lambda *given: made.setdefault("services", given))
    monkeypatch.setattr(node_module, "Heartbeat", lambda beat, is_alive: made.setdefault("beat", (beat, is_alive)))
    monkeypatch.setattr(node_module, "GoalServers", lambda *given: made.setdefault("goals", given))
    node._runner = SimpleNamespace(planner="the planner")  # type: ignore[assignment]
    node._approvals = "approvals"  # type: ignore[assignment]
    node._settings = SimpleNamespace(robot=SimpleNamespace(base_frame="base"))  # type: ignore[assignment]
    node._offer()
    assert made["surroundings"] == ("the planner", node._clouds, node._camera, "base", node._now_ns)
    given = made["services"]
    assert given[:6] == (
        node, node.gate, node._runner, "approvals", node._controllers.stop, made["surroundings"]
    )  # fmt: skip
    (report, turn) = bench.timers
    assert report[:2] == (1.0, node._report) and turn[:2] == (0.05, "a turn")
    for timer in bench.timers:
        assert timer[2]["clock"].clock_type == ClockType.STEADY_TIME, "they go on where ROS time stands"
        assert timer[2]["callback_group"] is given[6] is not None
    beat, is_alive = made["beat"]
    beat()
    assert [type(message).__name__ for message in bench.published] == ["Empty"] and is_alive == "alive"
    assert made["goals"] == (node, node._session, node.gate, "calls")


@pytest.mark.parametrize(("ends", "waits"), [(0.0, 0.2), (1.0, 1.2), (99.0, 3.2)])
def test_the_end_waits_for_what_runs_and_for_its_last_words(
    bench: Bench, ends: float, waits: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, begun, stopped = bench.node, bench.steady, list[float]()

    def sleep(seconds: float) -> None:
        assert node.gate.stopped, "what runs has to end"
        bench.steady += seconds
        if bench.steady - begun >= ends:
            node.gate.leave()

    monkeypatch.setattr(node_module, "time", SimpleNamespace(monotonic=lambda: bench.steady, sleep=sleep))
    node._heartbeat = SimpleNamespace(stop=lambda: stopped.append(bench.steady - begun))  # type: ignore[assignment]
    if ends:
        node.gate.enter()
    node.close()
    assert stopped == [pytest.approx(waits, abs=0.03)]
