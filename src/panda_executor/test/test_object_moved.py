"""Objects that move while the arm is on its way to them."""

from __future__ import annotations

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import Bowl, Cube, bowl_points, cube_points, seen_cloud

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.grasp import plan_grasps
from panda_executor.object_moved import seen_shift, vacated_share
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)


SMALL, WIDE = 0.04, 0.07  # edges of blocks [m]; the hand opens to 8 cm


@pytest.fixture(scope="session")
def planner(planned_once: TransferPlanner) -> TransferPlanner:
    return planned_once


def cloud_with_cube_at(shift: float, seed: int = 0, edge: float = SMALL) -> np.ndarray:
    """A block of so long an edge, 4 cm high, shifted along y by so much [m], the bowl where it is."""
    block = Cube(0.45, 0.1 + shift, 0.3, (edge, edge, 0.04))
    return seen_cloud(cube_points(block), bowl_points(Bowl(0.5, -0.2)), seed=seed)


@pytest.mark.parametrize(
    ("shift", "low", "high"), [(0.0, 0.0, 0.05), (0.01, 0.1, 0.45), (0.03, 0.5, 1.0), (0.1, 0.9, 1.0)]
)
def test_the_empty_share_grows_with_the_shift(workspace: WorkspaceSpec, shift: float, low: float, high: float) -> None:
    grasp = plan_grasps(cloud_with_cube_at(0.0), PICK, workspace)[0]
    assert low <= vacated_share(cloud_with_cube_at(shift, seed=1), grasp) <= high


def test_what_is_hidden_is_not_gone(workspace: WorkspaceSpec) -> None:
    before = cloud_with_cube_at(0.0)
    grasp = plan_grasps(before, PICK, workspace)[0]
    away = np.hypot(before[:, 0] - 0.45, before[:, 1] - 0.1) > 0.05
    assert vacated_share(before[away], grasp) == 0.0  # nothing is seen there
    hand = np.column_stack([np.random.default_rng(0).uniform([0.4, 0.05], [0.5, 0.15], (4000, 2)), np.full(4000, 0.2)])
    assert vacated_share(np.concatenate([before[away], hand.astype(np.float32)]), grasp) == 0.0


@pytest.mark.parametrize("shift", [0.0, 0.005, 0.01, 0.015])
def test_a_shift_is_measured_to_half_a_cell_or_so(workspace: WorkspaceSpec, shift: float) -> None:
    grasp = plan_grasps(cloud_with_cube_at(0.0), PICK, workspace)[0]
    np.testing.assert_allclose(seen_shift(cloud_with_cube_at(shift, seed=1), grasp), (0.0, shift), atol=0.003)


def test_what_stands_beside_an_object_is_not_taken_for_it(workspace: WorkspaceSpec) -> None:
    beside = Cube(0.45, 0.152, 0.0)  # 12 mm from it
    clouds = [seen_cloud(cube_points(Cube(0.45, 0.1)), cube_points(beside), seed=seed) for seed in (0, 1)]
    grasp = plan_grasps(clouds[0], PlanarPose(0.45, 0.1, 0.0), workspace)[0]
    np.testing.assert_allclose(seen_shift(clouds[1], grasp), (0.0, 0.0), atol=0.003)
    at = clouds[1][:, :2]
    for hidden in (np.hypot(at[:, 0] - 0.45, at[:, 1] - 0.12) < 0.08, at[:, 1] < 0.131):  # both, and the object alone
        np.testing.assert_array_equal(seen_shift(clouds[1][~hidden], grasp), (0.0, 0.0))


def run(
    planner: TransferPlanner, before: np.ndarray, later: np.ndarray, approved: bool = False
) -> tuple[ActionResult, FakeArm]:
    """Return how a pick and place ended whose object is where `later` shows it once the arm is above it."""
    arm = FakeArm()
    runner = PickPlaceRunner(planner.model, planner, arm, FakeGripper(opening=0.0))
    goal = ActionGoal(PickPlaceAction(PICK, PLACE))
    result = runner.run(goal, before, WorkspaceSpec(), on_plan=lambda motions: approved, look=lambda: later)
    return result, arm


def check_looked_for_anew(planner: TransferPlanner, result: ActionResult, arm: FakeArm) -> None:
    """Check that the hand did not go down, and that the arm went home."""
    assert result.outcome is Outcome.GRASP_MISSED, result.message
    assert "while the arm was under way the object moved" in result.message
    assert len(arm.sent) == 2, "the hand went down"
    np.testing.assert_allclose(arm.positions, load_preset().ready, atol=1e-6)


def test_a_small_shift_is_followed(planner: TransferPlanner) -> None:
    before = cloud_with_cube_at(0.0)
    result, arm = run(planner, before, cloud_with_cube_at(0.01, seed=1))
    assert result.outcome is Outcome.SUCCEEDED, result.message
    planned = plan_grasps(before, PICK, WorkspaceSpec())[0].centroid
    np.testing.assert_allclose(result.grasp_centroid, planned + np.array([0.0, 0.01, 0.0]), atol=0.003)
    down, up = arm.sent[1], arm.sent[2]
    np.testing.assert_allclose(planner.model.tcp_pose(down.end).translation[:2], result.grasp_centroid[:2], atol=1e-4)
    np.testing.assert_allclose(up.end, down.positions[0], atol=1e-6)


@pytest.mark.parametrize(
    ("size", "shift"), [(SMALL, 0.0), (SMALL, 0.01), (WIDE, 0.0), (WIDE, 0.01), (WIDE, 0.02), (WIDE, -0.015)]
)
def test_an_approved_way_down_is_gone_only_to_where_the_object_still_is(
    planner: TransferPlanner, size: float, shift: float
) -> None:
    """A block of 7 cm in a hand of 8 cm: a finger of the way that was approved would come down on it."""
    result, arm = run(planner, cloud_with_cube_at(0.0, 0, size), cloud_with_cube_at(shift, 1, size), approved=True)
    if shift == 0.0:
        assert result.outcome is Outcome.SUCCEEDED, result.message
    else:
        check_looked_for_anew(planner, result, arm)


@pytest.mark.parametrize(
    ("shift", "outcome"),
    [(0.0, Outcome.SUCCEEDED), (0.01, Outcome.SUCCEEDED), (0.03, Outcome.GRASP_MISSED), (0.1, Outcome.GRASP_MISSED)],
)
def test_an_object_that_moved_is_looked_for_anew(planner: TransferPlanner, shift: float, outcome: Outcome) -> None:
    result, arm = run(planner, cloud_with_cube_at(0.0), cloud_with_cube_at(shift, seed=1))
    assert result.outcome is outcome, result.message
    np.testing.assert_allclose(arm.positions, load_preset().ready, atol=1e-6)
    if outcome is Outcome.GRASP_MISSED:
        check_looked_for_anew(planner, result, arm)


@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, -1.0), (0.7, 0.7)])
@pytest.mark.parametrize("far", [0.01, 0.02, 0.03, 0.034, 0.05])
def test_a_wide_object_is_grasped_at_its_middle_or_looked_for_anew(
    planner: TransferPlanner, workspace: WorkspaceSpec, far: float, way: tuple[float, float]
) -> None:
    """Much of its place is still full where it moved by 3 cm."""
    x, y = far * np.array(way)
    bowl = bowl_points(Bowl(0.5, -0.2))
    before, later = (
        seen_cloud(cube_points(Cube(0.45 + dx, 0.1 + dy, 0.3, (WIDE, WIDE, 0.04))), bowl, seed=seed)
        for seed, (dx, dy) in enumerate([(0.0, 0.0), (x, y)])
    )
    result, arm = run(planner, before, later)
    if result.outcome is Outcome.SUCCEEDED:
        planned = plan_grasps(before, PICK, workspace)[0].centroid[:2]
        reached = planner.model.tcp_pose(arm.sent[1].end).translation[:2]
        np.testing.assert_allclose(reached, planned + np.array([x, y]), atol=0.003)
    else:
        check_looked_for_anew(planner, result, arm)
    if far != 0.02:  # which is where following ends
        assert (result.outcome is Outcome.SUCCEEDED) == (far < 0.02)


def test_an_object_whose_greater_part_is_flat_has_not_moved(planner: TransferPlanner) -> None:
    """A block on the middle of a plate that is grasped with it: most of it never rose over half of its height."""
    plate = cube_points(Cube(0.45, 0.1, 0.3, (0.07, 0.12, 0.012)))
    things = plate, cube_points(Cube(0.45, 0.1, 0.3, (0.04, 0.03, 0.02), 0.012)), bowl_points(Bowl(0.5, -0.2))
    before, later = (seen_cloud(*things, seed=seed) for seed in (0, 1))
    grasp = plan_grasps(before, PICK, WorkspaceSpec())[0]
    assert len(grasp.high) < len(grasp.inner) / 2
    assert vacated_share(later, grasp) < 0.05
