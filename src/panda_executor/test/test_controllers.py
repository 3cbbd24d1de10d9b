"""The arm's and the gripper's controllers as the node makes them of its parameters."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy")

from control_msgs.action import FollowJointTrajectory, GripperCommand
from franka_msgs.action import Grasp, Move

from panda_executor import node_controllers
from panda_executor.arm_watch import ArmWatch
from panda_executor.config import ExecutorConfig
from panda_executor.node_controllers import Controllers
from panda_model import load_preset

PANDA = load_preset("panda")
FR3 = replace(PANDA, arm_action="/arm", gripper_action="/gripper", franka_gripper="")


class Bench:
    """Controllers whose callers are played; `there` are the servers that are."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **robot: Any) -> None:
        self.there: set[str] = set()
        self.cancelled: list[str] = []
        self.callers: list[tuple[Any, ...]] = []
        self.made: dict[str, tuple[Any, ...]] = {}
        self.stopped = 0
        monkeypatch.setattr(node_controllers, "ActionCaller", self._caller)
        monkeypatch.setattr(node_controllers, "ActionArm", lambda *given: self._make("arm", given))
        monkeypatch.setattr(node_controllers, "ActionGripper", lambda *given: self._make("gripper", given))
        monkeypatch.setattr(node_controllers, "FrankaGripper", lambda *given: self._make("franka", given))
        clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=42))
        self.node: Any = SimpleNamespace(get_clock=lambda: clock)
        self.watch = ArmWatch(path_tolerance=0.7)
        config = replace(ExecutorConfig(), missed_width=0.0125)
        parameters: Any = SimpleNamespace(
            robot=replace(FR3, **robot), work_silence=0.25, watch=self.watch, config=config
        )
        self.controllers = Controllers(self.node, parameters, "joints", "on motion", "group")  # type: ignore[arg-type]

    def _caller(self, node: Any, kind: Any, name: str, group: Any, pulse: Any) -> SimpleNamespace:
        assert node is self.node and group == "group"
        self.callers.append((kind, name, pulse))
        return SimpleNamespace(
            name=name, is_ready=lambda: name in self.there, cancel_all=lambda: self.cancelled.append(name)
        )

    def _make(self, which: str, given: tuple[Any, ...]) -> SimpleNamespace:
        self.made[which] = given
        return SimpleNamespace(stop=lambda: self.cancelled.append(f"stop of the {which}"))


def test_each_controller_has_its_own_action_and_one_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    pulse = bench.controllers.pulse
    assert bench.callers == [(FollowJointTrajectory, "/arm", pulse), (GripperCommand, "/gripper", pulse)]
    assert pulse._longest == 0.25
    caller, joints, names, now_ns, watch, on_motion = bench.made["arm"]
    assert (caller.name, joints, names, watch, on_motion) == (
        "/arm", "joints", FR3.arm_joints, bench.watch, "on motion"
    )  # fmt: skip
    assert now_ns() == 42
    caller, joints, now_ns, *_ = bench.made["gripper"]
    assert (caller.name, joints, now_ns()) == ("/gripper", "joints", 42)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize(("stalled", "held_from"), [(True, math.inf), (False, 0.0125)])
def test_a_gripper_is_believed_in_what_it_reports(
    monkeypatch: pytest.MonkeyPatch, full: bool, stalled: bool, held_from: float
) -> None:
    bench = Bench(monkeypatch, gripper_reports_full_width=full, gripper_reports_stalled=stalled)
    assert bench.made["gripper"][3:] == (full, held_from)


def test_a_stop_reaches_both_controllers(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    bench.controllers.stop()
    assert bench.cancelled == ["stop of the gripper", "/arm", "/gripper"]


@pytest.mark.parametrize(("there", "arm", "gripper"), [("/arm", True, False), ("/gripper", False, True)])
def test_each_server_is_looked_for(monkeypatch: pytest.MonkeyPatch, there: str, arm: bool, gripper: bool) -> None:
    bench = Bench(monkeypatch)
    bench.there = {there}
    assert (bench.controllers.arm_ready, bench.controllers.gripper_ready) == (arm, gripper)


def test_a_gripper_that_offers_franka_msgs_is_moved_by_them(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, franka_gripper="/hand")
    assert [(kind, name) for kind, name, _ in bench.callers] == [
        (FollowJointTrajectory, "/arm"), (GripperCommand, "/gripper"), (Grasp, "/hand/grasp"), (Move, "/hand/move"),
    ]  # fmt: skip
    grasp, move, joints, _, hand = bench.made["franka"]
    assert (grasp.name, move.name, joints, hand) == ("/hand/grasp", "/hand/move", "joints", FR3.hand)
    assert "gripper" not in bench.made
    bench.there = {"/gripper", "/hand/grasp"}
    assert not bench.controllers.gripper_ready
    bench.there = {"/hand/move", "/hand/grasp"}
    assert bench.controllers.gripper_ready
    bench.controllers.stop()
    assert bench.cancelled == ["stop of the franka", "/arm", "/gripper", "/hand/grasp", "/hand/move"]
