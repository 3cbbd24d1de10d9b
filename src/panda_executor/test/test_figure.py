"""A figure that is held by its back: its head, which is higher, is its own and in nobody's way."""

import math

import numpy as np
import pytest
from synthetic_clouds import Cube, cloud_of, figure_points

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.object_moved import moved_problem, seen_shift
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

PICK = PlanarPose(0.435, 0.1, math.pi / 2)  # on its back


def standing(x: float = 0.45, y: float = 0.1) -> np.ndarray:
    table = cloud_of([Cube(x, y, size=(0.07, 0.036, 0.0))])
    return np.concatenate([table, figure_points(x, y).astype(np.float32)])


@pytest.fixture
def held(workspace: WorkspaceSpec) -> Grasp:
    return plan_grasps(standing(), PICK, workspace)[0]


def test_its_head_is_its_own_and_what_is_over_it_is_not(held: Grasp) -> None:
    over = np.array([[0.45, 0.1, 0.075]], np.float32)
    assert 0.039 < held.top_z < 0.05 and held.highest_z == pytest.approx(0.06, abs=1e-3)
    assert held.owns(figure_points(0.45, 0.1).astype(np.float32)).all() and not held.owns(over).any()
    assert held.held().above == pytest.approx(held.highest_z - held.tcp_z)


def test_it_is_raised(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    action = PickPlaceAction(PICK, PlanarPose(0.5, -0.1, math.pi / 2))
    plan = planner.plan(action, standing(), workspace, load_preset().ready)
    assert plan.grasp.highest_z > plan.grasp.top_z + 0.01
    way = plan.raise_up.trajectory
    positions = way.sample(np.linspace(0.0, way.duration, 100))[0]
    assert [plan.raise_up.scene.problem(q) for q in positions] == [None] * 100


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.01, -0.006)])
def test_it_is_found_again(held: Grasp, shift: tuple[float, float]) -> None:
    later = standing(0.45 + shift[0], 0.1 + shift[1])
    found = seen_shift(later, held)
    assert found is not None and np.abs(found - shift).max() < 0.003
    assert moved_problem(later, held, 0.4) is None
