"""Plans that waited for a person: they hold among what is seen by then, or nothing moves."""

from __future__ import annotations

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import Bowl, Cube, bowl_points, cube_points, seen_cloud

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import RequestError
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner

PICK_PLACE = PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3))
SWEEP = PickPlaceAction(PlanarPose(0.35, 0.0, 0.0), PlanarPose(0.35, 0.2, 0.0), Primitive.SWEEP)
FOLD = PickPlaceAction(PlanarPose(0.35, 0.0, 0.0), PlanarPose(0.35, 0.2, 0.0), Primitive.FOLD)


@pytest.fixture(scope="session")
def planner(planned_once: TransferPlanner) -> TransferPlanner:
    return planned_once


def scene(shift: float = 0.0, wall: Cube | None = None) -> np.ndarray:
    """The cube, shifted along y by so much [m], a bowl and perhaps something that was put on the table."""
    things = [cube_points(Cube(0.45, 0.1 + shift, 0.3)), bowl_points(Bowl(0.5, -0.2))]
    return seen_cloud(*things, *([] if wall is None else [cube_points(wall)]))


def approved(planner: TransferPlanner, action: PickPlaceAction, before: np.ndarray, after: np.ndarray) -> ActionResult:
    """Run an action whose scene changes while a person decides."""
    arm, gripper = FakeArm(), FakeGripper(opening=0.0)
    clouds = iter([before, after])
    runner = PickPlaceRunner(planner.model, planner, arm, gripper)
    result = runner.run(ActionGoal(action), lambda: next(clouds), WorkspaceSpec(), on_plan=lambda motions: True)
    assert bool(arm.sent) is result.outcome.is_success
    assert next(clouds, None) is None, "nobody looked again"
    return result


@pytest.mark.parametrize("action", [PICK_PLACE, SWEEP, FOLD])
def test_a_scene_that_stayed_is_acted_on(planner: TransferPlanner, action: PickPlaceAction) -> None:
    result = approved(planner, action, scene(), scene())
    assert result.outcome is Outcome.SUCCEEDED, result.message


@pytest.mark.parametrize(
    ("action", "wall"),
    [
        (PICK_PLACE, Cube(0.48, -0.05, size=(0.4, 0.04, 0.35))),
        (SWEEP, Cube(0.35, 0.1, size=(0.05, 0.05, 0.25))),
    ],
)
def test_what_was_put_in_the_way_meanwhile_is_not_hit(
    planner: TransferPlanner, action: PickPlaceAction, wall: Cube
) -> None:
    result = approved(planner, action, scene(), scene(wall=wall))
    assert result.outcome is Outcome.PLANNING_FAILED
    assert result.message.startswith("the scene changed while the plan waited for its approval: on the way")


def test_an_object_that_was_moved_meanwhile_is_not_grasped(planner: TransferPlanner) -> None:
    result = approved(planner, PICK_PLACE, scene(), scene(shift=0.1))
    assert result.outcome is Outcome.PLANNING_FAILED
    assert "the object moved: 100 % of its place is empty" in result.message


def test_a_camera_that_stopped_meanwhile_moves_nothing(planner: TransferPlanner) -> None:
    arm, clouds = FakeArm(), iter([scene()])

    def cloud() -> np.ndarray:
        for found in clouds:
            return found
        raise RequestError("the point cloud is 9.0 s old", Refusal.OLD_CLOUD)

    runner = PickPlaceRunner(planner.model, planner, arm, FakeGripper(opening=0.0))
    result = runner.run(ActionGoal(PICK_PLACE), cloud, WorkspaceSpec(), on_plan=lambda motions: True)
    assert (result.outcome, result.refusal, arm.sent) == (Outcome.REJECTED, Refusal.OLD_CLOUD, [])


def test_a_stop_while_a_cloud_is_waited_for_is_a_cancel(planner: TransferPlanner) -> None:
    """It used to end as a refusal: "the point cloud is too old"."""
    stops: list[bool] = []

    def cloud() -> np.ndarray:
        stops.append(True)
        raise RequestError("the point cloud is 9.0 s old", Refusal.OLD_CLOUD)

    runner = PickPlaceRunner(planner.model, planner, FakeArm(), FakeGripper(opening=0.0))
    result = runner.run(ActionGoal(PICK_PLACE), cloud, WorkspaceSpec(), should_stop=lambda: bool(stops))
    assert (result.outcome, result.refusal) == (Outcome.CANCELLED, Refusal.NONE)
    assert result.message.startswith("cancelled; nothing moved")
