"""Senseless goals: refused in one line, with a reason, and nothing moves."""

from __future__ import annotations

import numpy as np
from fake_ports import FakeArm, FakeGripper

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import Outcome, Refusal
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner

ODD = (float("nan"), float("inf"), -float("inf"), 1e300, -5.0, 0.0, 0.9)


def test_a_thousand_senseless_goals_move_nothing(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    arm, gripper = FakeArm(), FakeGripper(opening=0.0)
    runner, random = PickPlaceRunner(planner.model, planner, arm, gripper), np.random.default_rng(0)
    for _ in range(1000):
        values = random.uniform(-1.0, 1.0, 6)
        values[random.integers(6)] = random.choice(ODD)
        values[0] = random.choice(ODD)  # no goal that could be carried out
        pick, place = PlanarPose(*values[:3]), PlanarPose(*values[3:])
        action = PickPlaceAction(pick, place, Primitive(int(random.integers(len(Primitive)))))
        result = runner.run(ActionGoal(action), table_cloud, WorkspaceSpec())
        assert result.outcome is Outcome.REJECTED
        assert result.refusal in (Refusal.MALFORMED, Refusal.OUTSIDE_WORKSPACE)
        assert result.message and "\n" not in result.message
    assert arm.sent == [] and gripper.moves == []
