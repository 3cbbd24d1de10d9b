"""Conformance passes a right arm and fails each wrong one, at the check that is meant for it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy", exc_type=ImportError)

import rclpy
from fake_arm_node import FakeArmNode, Fault
from rclpy.context import Context
from rclpy.node import Node
from ros_domain import next_domain
from scripted_arm import ScriptedArm

from cliport_core import topics
from cliport_core.ros_running import SpinThread
from panda_driver.conformance import main as conformance
from panda_driver.conformance.checks import CHECKS
from panda_driver.conformance.main import Outcome, run_checks
from panda_driver.conformance.node_client import ArmClient
from panda_driver.conformance.plan import deviation, small_motion, spread
from panda_driver.conformance.subject import Bounds
from panda_model import load_preset

ROBOT = load_preset("panda")
# Generous where the machine may be busy; a fault is far beyond each.
BOUNDS = Bounds(rate=8.0, age=1.0, duration=1.0, patience=2.0, spare=1.0, cancel=3.0)
CAUGHT_BY = {
    Fault.ANY_TIMES: "times_increase",
    Fault.ANY_JOINTS: "joints_are_known",
    Fault.NO_LIMITS: "within_limits",
    Fault.ANY_START: "begins_here",
    Fault.NEVER_ENDS: "follows",
    Fault.LATE: "in_time",
    Fault.IDLE: "follows",
    Fault.ASTRAY: "follows",
    Fault.DEAF: "cancels",
    Fault.COASTS: "cancels",
    Fault.BOTH: "one_at_a_time",
    Fault.HALF_WIDTH: "hand_moves",
    Fault.FULL_FINGERS: "hand_moves",
    Fault.WIDE_HAND: "hand_range",
    Fault.RARE: "joint_states",
    Fault.OLD: "joint_states",
    Fault.LOST_JOINT: "joint_states",
}
Run = Callable[[Fault, list[str] | None], list[Outcome]]


@pytest.fixture
def run() -> Iterator[Run]:
    """Test a fake arm by the checks of these names, in a ROS domain of its own."""
    ends: list[Callable[[], object]] = []

    def run(fault: Fault, names: list[str] | None) -> list[Outcome]:
        context = Context()
        rclpy.init(context=context, domain_id=next_domain())
        nodes = [FakeArmNode(ROBOT, fault, context=context), Node("client", context=context)]
        client = ArmClient(nodes[1], ROBOT, BOUNDS)
        spinners = [SpinThread(node, lambda _: None, context) for node in nodes]
        ends.extend([spinner.stop for spinner in spinners] + [node.destroy_node for node in nodes])
        ends.append(lambda: rclpy.try_shutdown(context=context))
        client.missing(2.0 if fault is Fault.LOST_JOINT else 20.0, with_hand=True)
        return run_checks(client, [check for check in CHECKS if not names or check.name in names], lambda _: None)

    yield run
    for end in ends:
        end()


def test_a_right_arm_passes_every_check(run: Run) -> None:
    outcomes = run(Fault.NONE, None)
    assert [outcome.name for outcome in outcomes] == [check.name for check in CHECKS]
    assert not [outcome for outcome in outcomes if not outcome.passed]


@pytest.mark.parametrize("fault", CAUGHT_BY, ids=lambda fault: fault.name.lower())
def test_a_wrong_arm_fails(run: Run, fault: Fault) -> None:
    [outcome] = run(fault, [CAUGHT_BY[fault]])
    assert not outcome.passed, outcome.line


def test_every_fault_is_tried() -> None:
    assert set(CAUGHT_BY) == set(Fault) - {Fault.NONE}


def test_distances_from_a_motion() -> None:
    start = np.array(ROBOT.ready)
    plan = small_motion(start, ROBOT.limits, 0.1, 2.0)
    assert ROBOT.limits.contains(plan.positions)
    np.testing.assert_allclose(np.abs(plan.positions[-1] - start), 0.1)
    assert deviation(plan, list(plan.positions)) < 1e-3
    aside = plan.positions[10] + 0.05 * np.eye(7)[2]
    assert deviation(plan, [aside]) > 0.01
    assert spread([start, start + 0.2 * np.eye(7)[0], start]) == pytest.approx(0.2)


def test_what_is_not_there_is_named() -> None:
    context = Context()
    rclpy.init(context=context, domain_id=next_domain())
    node = Node("client", context=context)
    client = ArmClient(node, ROBOT, BOUNDS)
    assert client.missing(0.1, with_hand=True) == [ROBOT.arm_action, ROBOT.gripper_action, topics.JOINT_STATES]
    assert client.missing(0.1, with_hand=False) == [ROBOT.arm_action, topics.JOINT_STATES]
    assert client.wait(lambda: True, 0.0) and not client.wait(lambda: False, 0.05)
    node.destroy_node()
    rclpy.try_shutdown(context=context)


def test_what_was_found_is_written(tmp_path: Path) -> None:
    path = tmp_path / "found.json"
    outcomes = [Outcome("follows", True, "1 mrad"), Outcome("cancels", False, "no")]
    conformance._write(path, "fr3", BOUNDS, outcomes)
    found = json.loads(path.read_text())
    assert (found["format"], found["arm"], found["passed"], found["bounds"]["path"]) == (1, "fr3", False, BOUNDS.path)
    assert found["checks"][1] == {"name": "cancels", "passed": False, "line": "no"}


@pytest.mark.parametrize(
    ("arm", "code", "said"),
    [
        (ScriptedArm(), 0, "1 of 1 checks passed\n"),
        (ScriptedArm(old=1.0), 1, "0 of 1 checks passed: not joint_states\n"),
    ],
)
def test_the_command_says_passed_or_not_and_writes_what_it_found(
    arm: ScriptedArm, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.setattr(conformance, "ArmClient", lambda node, robot, bounds: arm)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    assert conformance.main(["--only", "joint_states"]) == code
    path = tmp_path / "found.json"
    assert conformance.main(["--only", "joint_states", "--out", str(path)]) == code
    assert capfd.readouterr().out.endswith(said)
    found = json.loads(path.read_text())
    assert [check["name"] for check in found["checks"]] == ["joint_states"] and found["passed"] == (code == 0)
    assert conformance.main(["--only", "joint_states", "--out", str(tmp_path / "no" / "found.json")]) == 2
    assert "cannot write" in capfd.readouterr().err


def test_an_arm_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(conformance, "_DISCOVERY", 0.1)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    assert conformance.main(["--arm", "fr3"]) == 2
    assert "nothing at /fr3_arm_controller/follow_joint_trajectory" in capfd.readouterr().err
    assert conformance.main(["--arm", "pr2"]) == 2


def test_no_check_at_all_is_not_passed(capfd: pytest.CaptureFixture[str]) -> None:
    assert conformance.main(["--only", "hand_moves", "--no-hand"]) == 2
    assert "leaves none of the checks" in capfd.readouterr().err
