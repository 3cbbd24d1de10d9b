"""How the executor's node joins its parts: each is given the parameters, clocks and parts that are meant for it."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("cliport_interfaces.action")

from rclpy.node import Node

from panda_executor import node as module
from panda_executor import node_description
from panda_executor.health import AgeLimits
from panda_executor.node import ExecutorNode
from panda_model import load_preset

PANDA = load_preset()
PARAMETERS = SimpleNamespace(
    robot=PANDA, robot_description="<robot/>", config="config", max_joint_age=0.4, max_cloud_age=1.5, max_ahead=0.2,
    cloud_behind=0.1, owner_silence=0.3, guard_silence=2.5, approval_time=12.0, self_clearance=0.04, cameras=2,
)  # fmt: skip


class Bench:
    """A node all of whose parts are played: `made` are the values that each was made with."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, notice: str = "") -> None:
        self.made: dict[str, tuple[tuple[Any, ...], dict[str, Any]]] = {}
        self.words: list[str] = []
        self.calls: list[str] = []
        parts = (
            "JointTracker", "CloudCache", "CameraPlace", "Controllers", "OwnerWatch", "PlanPreviews", "Approvals",
            "GuardWatch", "GoalSession", "PandaModel", "TransferPlanner", "PickPlaceRunner",
        )  # fmt: skip
        for name in parts:
            monkeypatch.setattr(module, name, self._maker(name))
        monkeypatch.setattr(module, "read_parameters", lambda node: PARAMETERS)
        monkeypatch.setattr(node_description, "load_description", self._describe)
        self.description = SimpleNamespace(notice=notice)
        monkeypatch.setattr(Node, "__init__", lambda node, name: self.calls.append(f"node {name}"))
        logger = SimpleNamespace(warning=self.words.append)
        monkeypatch.setattr(ExecutorNode, "get_logger", lambda node: logger)
        monkeypatch.setattr(ExecutorNode, "_now_ns", lambda node: 42)
        monkeypatch.setattr(ExecutorNode, "_subscribe", lambda node: self.calls.append("subscribe"))
        monkeypatch.setattr(ExecutorNode, "_offer", lambda node: self.calls.append("offer"))
        self.node = ExecutorNode()

    def _maker(self, name: str) -> Callable[..., SimpleNamespace]:
        def make(*given: Any, **named: Any) -> SimpleNamespace:
            self.made[name] = given, named
            return SimpleNamespace(
                of=name, model="the model", arm="the arm", gripper="the gripper", show="show", planner=self._planner(),
                is_still=lambda now_ns: now_ns == 42 and self.still,
            )  # fmt: skip

        return make

    still = True

    def _planner(self) -> SimpleNamespace:
        return SimpleNamespace(model="the model")

    def _describe(self, robot: Any, text: str) -> SimpleNamespace:
        assert (robot, text) == (PANDA, "<robot/>")
        return self.description


def name_of(part: Any) -> str:
    return str(getattr(part, "of", part))


def test_each_part_is_given_what_is_meant_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    made, node = bench.made, bench.node
    assert made["JointTracker"][0] == (PANDA.arm_joints, PANDA.finger_joints, 0.4, 0.2)
    assert made["CloudCache"][0] == (1.5, 0.1, 0.2)
    assert made["CameraPlace"][0] == (PANDA.base_frame, 2)
    assert node._limits == AgeLimits(joints=0.4, cloud=1.5, ahead=0.2)
    own, parameters, joints, on_motion, group = made["Controllers"][0]
    assert own is node and parameters is PARAMETERS and name_of(joints) == "JointTracker"
    assert on_motion == node.gate.note_motion and group is node._calls
    assert made["PandaModel"][0] == (PANDA, 0.04, bench.description)
    planner = made["TransferPlanner"][0]
    assert (name_of(planner[0]), planner[1]) == ("PandaModel", "config")
    model, planner, arm, gripper = made["PickPlaceRunner"][0]
    assert [name_of(part) for part in (model, planner, arm, gripper)] == [
        "PandaModel", "TransferPlanner", "the arm", "the gripper"
    ]  # fmt: skip
    assert made["OwnerWatch"][0][1] == 0.3
    assert made["PlanPreviews"][0] == (node, "the model", PANDA.base_frame)
    assert made["Approvals"] == ((12.0,), {"show": "show"})
    assert made["GuardWatch"][0][1] == 2.5
    *parts, now_ns, watchers, approvals = made["GoalSession"][0]
    assert parts[3] is PARAMETERS and parts[4] is node.gate and now_ns() == 42
    names = [name_of(part) for part in (*parts[:3], *watchers, approvals)]
    assert names == ["PickPlaceRunner", "CloudCache", "CameraPlace", "OwnerWatch", "GuardWatch", "Approvals"]
    assert bench.calls == ["node panda_executor", "subscribe", "offer"], "it offers once it can hear"
    assert bench.words == []


def test_a_goal_waits_for_a_measured_standstill(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.node.gate.note_motion()
    bench.still = False
    assert "was not seen to stand still" in (bench.node.gate.refusal() or "")
    bench.still = True
    assert bench.node.gate.refusal() is None


def test_what_is_odd_about_a_description_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Bench(monkeypatch, "the description has no collision shapes").words == [
        "the description has no collision shapes"
    ]
