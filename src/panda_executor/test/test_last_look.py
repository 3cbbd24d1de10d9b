"""What came to where the hand is to go down, and the way back from there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import Bowl, Cube, bowl_points, cube_points, seen_cloud

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import AfterFailure
from panda_executor.errors import RequestError
from panda_executor.hand_geometry import HandShape
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_executor.validation import dense_positions

YAW = 0.3
PICK, PLACE = PlanarPose(0.45, 0.1, YAW), PlanarPose(0.5, -0.2, YAW)
PICKED, BOWL = cube_points(Cube(0.45, 0.1, YAW)), bowl_points(Bowl(0.5, -0.2))
BLOCK, SMALL = (0.03, 0.03, 0.03), (0.04, 0.04, 0.04)


def beside(along: float, across: float, size: tuple[float, float, float] = BLOCK, z: float = 0.0) -> np.ndarray:
    """A block so far from the pick along the direction in which the fingers close, and across it [m]."""
    c, s = math.cos(YAW), math.sin(YAW)
    return cube_points(Cube(0.45 + c * along - s * across, 0.1 + s * along + c * across, YAW, size, z))


def run(
    planner: TransferPlanner,
    before: np.ndarray,
    look: Callable[[], np.ndarray],
    primitive: Primitive = Primitive.PICK_PLACE,
    rule: AfterFailure = AfterFailure.STAY,
) -> tuple[ActionResult, FakeArm]:
    """Return how an action that was planned in `before` ended."""
    arm, gripper = FakeArm(), FakeGripper(opening=0.0)
    runner = PickPlaceRunner(planner.model, planner, arm, gripper, replace(planner.config, after_failure=rule))
    result = runner.run(ActionGoal(PickPlaceAction(PICK, PLACE, primitive)), before, WorkspaceSpec(), look=look)
    return result, arm


def check_not_gone_down(result: ActionResult, arm: FakeArm) -> None:
    """Check that the arm went home from above, to be sent again."""
    assert result.outcome is Outcome.GRASP_MISSED, result.message
    assert "while the arm was under way something came there" in result.message
    assert len(arm.sent) == 2, "the hand went down"


@pytest.mark.parametrize(
    "came", [beside(0.05, 0.0), beside(-0.05, 0.01), beside(0.0, 0.0, BLOCK, 0.04)], ids=["left", "right", "on it"]
)
def test_no_finger_is_put_on_what_came_beside_an_object(planner: TransferPlanner, came: np.ndarray) -> None:
    before, later = seen_cloud(PICKED, BOWL), seen_cloud(PICKED, BOWL, came, seed=1)
    check_not_gone_down(*run(planner, before, lambda: later))


@pytest.mark.parametrize(
    "came", [beside(0.0, 0.06), beside(0.15, 0.0), np.zeros((0, 3))], ids=["across", "far", "nothing"]
)
@pytest.mark.parametrize("shift", [0.0, 0.01])
def test_what_came_where_no_finger_goes_does_not_matter(
    planner: TransferPlanner, came: np.ndarray, shift: float
) -> None:
    """Nor is the object itself in the way, where it was or a little beside."""
    picked = PICKED + np.array([0.0, shift, 0.0])
    before, later = seen_cloud(PICKED, BOWL), seen_cloud(picked, BOWL, came, seed=1)
    result, _ = run(planner, before, lambda: later)
    assert result.outcome is Outcome.SUCCEEDED, result.message


def test_what_the_hand_hides_did_not_come(planner: TransferPlanner) -> None:
    """The hand itself is seen over the object, and some pixels at its edge seem to fly below it."""
    hand = np.concatenate([beside(0.0, 0.0, (0.2, 0.06, 0.15), 0.22), beside(0.0, 0.0, (0.1, 0.02, 0.08), 0.16)])
    edge = np.repeat(beside(0.05, 0.0, (0.001, 0.001, 0.001), 0.08)[:1], 2, axis=0)
    before, later = seen_cloud(PICKED, BOWL), seen_cloud(PICKED, BOWL, hand, edge, seed=1)
    result, _ = run(planner, before, lambda: later)
    assert result.outcome is Outcome.SUCCEEDED, result.message


@pytest.mark.parametrize("primitive", [Primitive.SWEEP, Primitive.FOLD])
@pytest.mark.parametrize(
    ("x", "y", "size", "free"),
    [
        (0.45, 0.1, BLOCK, False),  # where the hand goes down
        (0.475, -0.05, BLOCK, True),  # to be moved, as if it had been there before
        (0.475, -0.05, (0.05, 0.05, 0.1), False),  # too tall for that
        (0.6, 0.1, (0.05, 0.05, 0.1), True),  # out of the way
    ],
)
def test_no_hand_goes_down_on_what_came_into_a_drags_way(
    planner: TransferPlanner,
    primitive: Primitive,
    x: float,
    y: float,
    size: tuple[float, float, float],
    free: bool,
) -> None:
    before, later = seen_cloud(), seen_cloud(cube_points(Cube(x, y, 0.0, size)))
    result, arm = run(planner, before, lambda: later, primitive)
    if free:
        assert result.outcome is Outcome.SUCCEEDED, result.message
    else:
        check_not_gone_down(result, arm)


def passes(planner: TransferPlanner, arm: FakeArm, first: int, cloud: np.ndarray) -> bool:
    """Return whether the motions that were sent from number `first` on touch nothing that a cloud shows."""
    grid = replace(planner.grid(cloud, WorkspaceSpec(), arm.sent[0].start), seen=None)
    scene = planner.scene(grid, HandShape(planner.config.hand))
    return all(scene.is_valid(at) for way in arm.sent[first:] for at in dense_positions(way.positions, scene))


@pytest.mark.parametrize("again", [True, False])
@pytest.mark.parametrize(
    ("at_place", "tower"),
    [(False, Cube(0.42, -0.06, 0.0, (0.05, 0.05, 0.42))), (True, Cube(0.45, 0.05, 0.0, (0.05, 0.05, 0.6)))],
    ids=["object", "place"],
)
def test_the_way_back_leads_round_what_came(planner: TransferPlanner, at_place: bool, tower: Cube, again: bool) -> None:
    """A tower on the way home, and a block where the hand was to go down: the plan's cloud shows neither.

    again: whether one more cloud comes when the arm is to go back.
    """
    before = seen_cloud(PICKED, BOWL)
    block = cube_points(Cube(0.5, -0.2, YAW, (0.05, 0.05, 0.09))) if at_place else beside(0.05, 0.0)
    things = (PICKED, BOWL, cube_points(tower, 0.003), block)
    came = seen_cloud(*things)
    x, y, z = (0.5, -0.2, 0.165) if at_place else (0.45, 0.1, 0.146)  # of the tcp, over the place and the object
    hand = [cube_points(Cube(x, y, YAW, (0.2, 0.06, 0.15), z + 0.05)), cube_points(Cube(x, y, YAW, SMALL, z - 0.02))]
    later = seen_cloud(*things, *hand[: 2 if at_place else 1])
    looks = [*([before] if at_place else []), later, *([later] if again else [])]

    def look() -> np.ndarray:
        if not looks:
            raise RequestError("none came")
        return looks.pop(0)

    result, arm = run(planner, before, look, rule=AfterFailure.KEEP)
    assert result.outcome is (Outcome.EXECUTION_FAILED if at_place else Outcome.GRASP_MISSED)
    assert "something came there" in result.message
    assert np.abs(arm.positions - planner.ready).max() < 1e-6, result.message
    assert passes(planner, arm, 4 if at_place else 1, came)
