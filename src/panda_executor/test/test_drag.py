"""Sweeps and folds: how high, how turned, how near to the base, and for how long they are sought."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_clouds import Cube, cloud_of

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.drag import broadside, plan_drag
from panda_executor.errors import PlanningError
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

HAND = load_preset().hand

READY_POSITIONS = load_preset().ready


@pytest.mark.parametrize("primitive", [Primitive.SWEEP, Primitive.FOLD])
def test_the_fingertips_keep_their_height(
    planner: TransferPlanner, workspace: WorkspaceSpec, primitive: Primitive
) -> None:
    action = PickPlaceAction(PlanarPose(0.45, -0.1, 0.0), PlanarPose(0.5, 0.1, 0.5), primitive)
    plan = plan_drag(planner, action, cloud_of([Cube(0.46, 0.0)]), workspace, READY_POSITIONS)
    tips = [planner.model.tcp_arrays(q)[1][2] - HAND.fingertip_below_tcp for q in plan.drag.trajectory.positions]
    drag = planner.config.drag
    lift = drag.fold_lift if primitive is Primitive.FOLD else 0.0
    np.testing.assert_allclose(tips, drag.tip_clearance + lift, atol=1e-3)


@pytest.mark.parametrize("yaw", [0.0, 1.0])
def test_a_sweep_stands_broadside_whatever_yaw_is_asked_for(yaw: float) -> None:
    action = PickPlaceAction(PlanarPose(0.4, 0.0, yaw), PlanarPose(0.5, 0.1, 2.0), Primitive.SWEEP)
    done = broadside(action)
    assert done.pick.yaw == done.place.yaw == pytest.approx(math.pi / 4 + math.pi / 2)
    still = replace(action, place=action.pick)
    assert broadside(still) == still
    fold = replace(action, primitive=Primitive.FOLD)
    assert broadside(fold) == fold


def test_the_hand_leans_where_it_could_not_rise_upright(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    action = PickPlaceAction(PlanarPose(0.368, -0.048, 0.03), PlanarPose(0.274, -0.056, -0.14), Primitive.FOLD)
    plan = plan_drag(planner, action, cloud_of([Cube(0.5, 0.2)]), workspace, READY_POSITIONS)
    low, high = (planner.model.tcp_pose(q) for q in (plan.leave.trajectory.start, plan.leave.trajectory.end))
    np.testing.assert_allclose(low.translation[:2], [0.274, -0.056], atol=1e-3)
    assert low.rotation[2, 2] == pytest.approx(-1.0, abs=1e-5)  # upright while it holds
    assert high.translation[2] - low.translation[2] > 0.09 and high.rotation[2, 2] > -0.99


def test_planning_a_drag_ends_when_its_time_is_up(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    late = TransferPlanner(planner.model, clock=iter(range(0, 1000, 100)).__next__)
    action = PickPlaceAction(PlanarPose(0.45, -0.1, 0.0), PlanarPose(0.5, 0.1, 0.0), Primitive.SWEEP)
    with pytest.raises(PlanningError, match="planning took too long"):
        plan_drag(late, action, cloud_of([Cube(0.46, 0.0)]), workspace, READY_POSITIONS)
