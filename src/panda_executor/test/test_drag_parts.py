"""What a drag is made of: its speed along the table, the ground that it clears, its ways out, and its second look."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_clouds import Cube, cloud_of

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import drag
from panda_executor.drag import DragPlan, plan_drag, renewed_drag
from panda_executor.errors import PlanningError, TrajectoryError
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

HAND, READY = load_preset().hand, load_preset().ready
START, END = (0.45, -0.1), (0.5, 0.1)
EMPTY = np.zeros((0, 3), dtype=np.float32)


def action(primitive: Primitive) -> PickPlaceAction:
    return PickPlaceAction(PlanarPose(*START, 0.2), PlanarPose(*END, 0.7), primitive)


def fastest(planner: TransferPlanner, motion: Motion) -> float:
    """Return the tcp's highest speed [m/s]."""
    way = motion.trajectory
    times = np.linspace(0.0, way.duration, 400)
    at = np.array([planner.model.tcp_arrays(q)[1] for q in way.sample(times)[0]])
    return float(np.linalg.norm(np.diff(at, axis=0), axis=1).max() / (times[1] - times[0]))


@pytest.fixture(scope="module")
def slow(planner: TransferPlanner) -> TransferPlanner:
    """Return a planner that drags much slower than it does anything else."""
    config = replace(planner.config, drag=replace(planner.config.drag, speed=0.05))
    return TransferPlanner(planner.model, config)


@pytest.fixture(scope="module")
def sweep(slow: TransferPlanner, workspace: WorkspaceSpec) -> DragPlan:
    return plan_drag(slow, action(Primitive.SWEEP), EMPTY, workspace, READY)


@pytest.fixture(scope="module")
def fold(slow: TransferPlanner, workspace: WorkspaceSpec) -> DragPlan:
    return plan_drag(slow, action(Primitive.FOLD), EMPTY, workspace, READY)


def test_only_the_way_along_the_table_has_the_drags_speed(
    slow: TransferPlanner, sweep: DragPlan, fold: DragPlan
) -> None:
    near = slow.config.timing.tcp_speed_near
    for plan in (sweep, fold):
        assert 0.04 < fastest(slow, plan.drag) <= 0.0501
        for motion in (plan.descend, plan.leave, plan.escape):
            assert 0.06 < fastest(slow, motion) <= near * 1.01
        for motion in (plan.go_above, plan.retreat):
            assert fastest(slow, motion) > 0.06


def test_each_motion_has_its_phase_and_begins_where_the_one_before_ended(sweep: DragPlan, fold: DragPlan) -> None:
    phases = [Phase.GO_ABOVE_PICK, Phase.DESCEND, Phase.CARRY, Phase.RETREAT, Phase.RETREAT]
    assert [m.phase for m in sweep.motions] == phases
    assert [m.phase for m in fold.motions] == [*phases[:2], Phase.RAISE, *phases[2:]]
    for plan in (sweep, fold):
        np.testing.assert_allclose(plan.go_above.trajectory.start, READY, atol=1e-9)
        for before, after in zip(plan.motions, plan.motions[1:], strict=False):
            np.testing.assert_allclose(before.trajectory.end, after.trajectory.start, atol=1e-6)
        np.testing.assert_allclose(plan.retreat.trajectory.end, READY, atol=1e-6)
        np.testing.assert_allclose(plan.escape.trajectory.start, plan.descend.trajectory.end, atol=1e-9)
        np.testing.assert_allclose(plan.escape.trajectory.end, plan.descend.trajectory.start, atol=1e-9)
        assert plan.escape.phase is Phase.RETREAT
    assert sweep.lift is None and fold.lift is not None
    assert sweep.opening == 0.0 and fold.opening == HAND.fold_opening > 0.0


def test_the_hand_goes_from_pick_to_place_in_a_line_and_stays_above(
    slow: TransferPlanner, sweep: DragPlan, fold: DragPlan
) -> None:
    high = slow.config.approach_height
    for plan, lift in ((sweep, 0.0), (fold, slow.config.drag.fold_lift)):
        low = HAND.fingertip_below_tcp + slow.config.drag.tip_clearance
        way = plan.drag.trajectory
        at = np.array([slow.model.tcp_arrays(q)[1] for q in way.sample(np.linspace(0.0, way.duration, 50))[0]])
        np.testing.assert_allclose(at[[0, -1], :2], [START, END], atol=1e-4)
        np.testing.assert_allclose(at[:, 2], low + lift, atol=1e-3)
        forth = np.subtract(END, START) / np.linalg.norm(np.subtract(END, START))
        beside = (at[:, :2] - START) @ np.array([-forth[1], forth[0]])
        assert float(np.abs(beside).max()) < 1e-3
        above = slow.model.tcp_arrays(plan.descend.trajectory.start)[1]
        np.testing.assert_allclose(above, [*START, low + high], atol=1e-3)
        left = slow.model.tcp_arrays(plan.leave.trajectory.end)[1]
        np.testing.assert_allclose(left, [*END, low + high], atol=1e-3)


def test_a_fold_turns_from_the_picks_yaw_to_the_places(slow: TransferPlanner, fold: DragPlan) -> None:
    rotations = [slow.model.tcp_arrays(q)[0] for q in (fold.drag.trajectory.start, fold.drag.trajectory.end)]
    turn = rotations[0].T @ rotations[1]
    assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) == pytest.approx(np.degrees(0.5), abs=0.1)


@pytest.mark.parametrize(
    ("pick", "place", "turned"),
    [
        (PlanarPose(0.57, 0.12, 2.81), PlanarPose(0.27, -0.02, -0.07), math.pi - 2.88),  # the other way
        (PlanarPose(0.54, -0.15, -1.39), PlanarPose(0.26, -0.07, -1.69), 0.0),
    ],
)
def test_a_fold_that_the_arm_cannot_turn_so_is_turned_otherwise(
    slow: TransferPlanner, workspace: WorkspaceSpec, pick: PlanarPose, place: PlanarPose, turned: float
) -> None:
    plan = plan_drag(slow, PickPlaceAction(pick, place, Primitive.FOLD), EMPTY, workspace, READY)
    (first, _), (last, at) = (slow.model.tcp_arrays(q) for q in (plan.lift.trajectory.end, plan.drag.trajectory.end))  # type: ignore[union-attr]
    turn = first.T @ last
    assert math.acos(min((np.trace(turn) - 1.0) / 2.0, 1.0)) == pytest.approx(turned, abs=0.01)
    np.testing.assert_allclose(at[:2], [place.x, place.y], atol=1e-3)


def test_things_low_and_near_the_line_are_moved_and_all_others_avoided(
    slow: TransferPlanner, workspace: WorkspaceSpec
) -> None:
    """The line runs from (0.3, -0.2) to (0.5, 0.0); 0.0707 m beside it is 0.05 m off along either axis."""
    wide, low = slow.config.drag.corridor, slow.config.drag.low
    line = PickPlaceAction(PlanarPose(0.3, -0.2, 0.0), PlanarPose(0.5, 0.0, 0.0), Primitive.SWEEP)
    parts = drag._Drag(slow, line, EMPTY, workspace, READY, slow.budget())
    s = np.sqrt(0.5)
    across, along = np.array([-s, s]), np.array([s, s])
    middle, end = np.array([0.4, -0.1]), np.array([0.5, 0.0])
    near, far = wide - 1e-4, wide + 1e-4
    cases = [
        (middle, low - 1e-4, True),
        (middle, low + 1e-4, False),
        (middle + near * across, 0.01, True),
        (middle + far * across, 0.01, False),
        (middle - near * across, 0.01, True),
        (middle - far * across, 0.01, False),
        (end + near * along, 0.01, True),
        (end + far * along, 0.01, False),
        (np.array([0.3, -0.2]) - near * along, 0.01, True),
        (np.array([0.3, -0.2]) - far * along, 0.01, False),
    ]
    points = np.array([[*at, z] for at, z, _ in cases], dtype=np.float32)
    assert parts._in_corridor(points).tolist() == [moved for _, _, moved in cases]


def test_a_drag_to_where_it_begins_clears_the_ground_round_it(slow: TransferPlanner, workspace: WorkspaceSpec) -> None:
    still = PickPlaceAction(PlanarPose(0.4, 0.1, 0.0), PlanarPose(0.4, 0.1, 0.0), Primitive.FOLD)
    parts = drag._Drag(slow, still, EMPTY, workspace, READY, slow.budget())
    wide = slow.config.drag.corridor
    points = np.array([[0.4, 0.1, 0.01], [0.4 + wide - 1e-3, 0.1, 0.01], [0.4, 0.1 + wide + 1e-3, 0.01]], np.float32)
    assert parts._in_corridor(points).tolist() == [True, True, False]


@pytest.mark.parametrize("where", [START, END, (0.475, 0.0)])
def test_the_second_look_finds_what_came_into_the_way(
    slow: TransferPlanner, workspace: WorkspaceSpec, sweep: DragPlan, where: tuple[float, float]
) -> None:
    same = renewed_drag(slow, action(Primitive.SWEEP), sweep, EMPTY, workspace, READY)
    assert [m.phase for m in same.motions] == [m.phase for m in sweep.motions]
    column = cloud_of([Cube(*where, 0.0, (0.04, 0.04, 0.3))])
    with pytest.raises(TrajectoryError, match="would touch"):
        renewed_drag(slow, action(Primitive.SWEEP), sweep, column, workspace, READY)


def test_each_motion_is_looked_at_again_among_its_own_columns(
    slow: TransferPlanner, workspace: WorkspaceSpec, fold: DragPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A low thing on the line is to be moved: it counts for the way there alone."""
    seen: dict[int, float] = {}

    def note(self: object, motion: Motion, grid: ObstacleGrid) -> Motion:
        seen[id(motion)] = float(grid.highest)
        return motion

    monkeypatch.setattr("panda_executor.motions.MotionBuilder.among", note)
    low = cloud_of([Cube(0.475, 0.0, 0.0, (0.04, 0.04, 0.03))])
    renewed_drag(slow, action(Primitive.FOLD), fold, low, workspace, READY)
    assert seen[id(fold.go_above)] > 0.02
    assert fold.lift is not None
    for motion in (fold.descend, fold.escape, fold.lift, fold.drag, fold.leave, fold.retreat):
        assert seen[id(motion)] <= 0.0


def test_a_drag_beyond_the_arm_says_which_part_fails(slow: TransferPlanner, workspace: WorkspaceSpec) -> None:
    far = PickPlaceAction(PlanarPose(0.5, 0.0, 0.0), PlanarPose(0.95, 0.0, 0.0), Primitive.SWEEP)
    with pytest.raises(PlanningError, match="sweep from the pick to the place: the hand cannot follow the line"):
        plan_drag(slow, far, EMPTY, workspace, READY)


def test_a_fold_out_of_reach_is_sought_once_not_for_each_turn(
    slow: TransferPlanner, workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    sought: list[tuple[float, float]] = []
    above_pick = drag._Drag.above_pick

    def noted(self: drag._Drag, flip: float, lean: float) -> Pose:
        sought.append((flip, lean))
        return above_pick(self, flip, lean)

    monkeypatch.setattr(drag._Drag, "above_pick", noted)
    far = PickPlaceAction(PlanarPose(0.95, 0.0, 0.3), PlanarPose(0.5, 0.0, 1.0), Primitive.FOLD)
    with pytest.raises(PlanningError, match="fold from the pick to the place: the hand cannot reach"):
        plan_drag(slow, far, EMPTY, workspace, READY)
    assert len(sought) == len(set(sought)) > 1
