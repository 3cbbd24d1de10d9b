"""Places that change while the arm carries something to them."""

from __future__ import annotations

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import Bowl, Cube, bowl_points, cube_points, seen_cloud

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner

PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)
PICKED = cube_points(Cube(0.45, 0.1, 0.3))
PLINTH = (0.08, 0.08, 0.05)


@pytest.fixture(scope="session")
def planner(planned_once: TransferPlanner) -> TransferPlanner:
    return planned_once


def carried(
    planner: TransferPlanner, before: np.ndarray, later: np.ndarray
) -> tuple[ActionResult, FakeArm, FakeGripper]:
    """Return how a pick and place ended whose place looks as `later` shows when the arm has come there."""
    arm, gripper = FakeArm(), FakeGripper(opening=0.0)
    runner = PickPlaceRunner(planner.model, planner, arm, gripper)
    looks = iter((before, later))  # above the object, then above the place
    goal = ActionGoal(PickPlaceAction(PICK, PLACE))
    result = runner.run(goal, before, WorkspaceSpec(), look=lambda: next(looks, None))
    return result, arm, gripper


def check_kept(ended: tuple[ActionResult, FakeArm, FakeGripper]) -> None:
    """Check that nothing was let go and that the hand did not go down to the place."""
    result, arm, gripper = ended
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert "the place changed while the arm was under way" in result.message
    assert gripper.opening == pytest.approx(gripper.object_width), "the object was let go"
    assert len(arm.sent) == 4, "the arm went on after it had carried the object there"


@pytest.mark.parametrize("seed", range(3))
def test_a_place_that_stays_is_used(planner: TransferPlanner, seed: int) -> None:
    bowl = bowl_points(Bowl(0.5, -0.2))
    result, _, _ = carried(planner, seen_cloud(PICKED, bowl), seen_cloud(bowl, seed=seed))
    assert result.outcome is Outcome.SUCCEEDED, result.message


@pytest.mark.parametrize("size", [(0.05, 0.05, 0.05), (0.04, 0.04, 0.09)])
def test_nothing_is_put_into_what_came_to_the_place(planner: TransferPlanner, size: tuple[float, float, float]) -> None:
    came = cube_points(Cube(0.5, -0.2, 0.3, size))
    check_kept(carried(planner, seen_cloud(PICKED), seen_cloud(came)))


def test_a_bowl_that_moved_by_half_its_width_is_noticed(planner: TransferPlanner) -> None:
    before = seen_cloud(PICKED, bowl_points(Bowl(0.5, -0.2)))
    check_kept(carried(planner, before, seen_cloud(bowl_points(Bowl(0.5, -0.15)))))


def test_nothing_is_dropped_where_its_support_is_gone(planner: TransferPlanner) -> None:
    before = seen_cloud(PICKED, cube_points(Cube(0.5, -0.2, 0.3, PLINTH)))
    check_kept(carried(planner, before, seen_cloud(PICKED)))


def test_what_was_picked_is_no_obstacle_where_it_stood(planner: TransferPlanner) -> None:
    bowl = bowl_points(Bowl(0.5, -0.2))
    before = seen_cloud(PICKED, bowl)
    assert carried(planner, before, before)[0].outcome is Outcome.SUCCEEDED


def test_a_hidden_place_proves_nothing(planner: TransferPlanner) -> None:
    before = seen_cloud(PICKED, cube_points(Cube(0.5, -0.2, 0.3, PLINTH)))
    hidden = before[np.hypot(before[:, 0] - 0.5, before[:, 1] + 0.2) > 0.12]
    assert carried(planner, before, hidden)[0].outcome is Outcome.SUCCEEDED
