"""What a plan shows of itself: exactly the motions that will be executed."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_clouds import CAMERA, Bowl, Cube, bowl_points, cube_points, seen_cloud

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.approvals import Approvals
from panda_executor.phase import Phase
from panda_executor.plan_preview import joined, paths, picture
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import load_preset

PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)


@pytest.fixture(scope="module")
def plan(planner: TransferPlanner) -> PickPlacePlan:
    cloud = seen_cloud(cube_points(Cube(0.45, 0.1, 0.3)), bowl_points(Bowl(0.5, -0.2)))
    return planner.plan(PickPlaceAction(PICK, PLACE), cloud, WorkspaceSpec(), load_preset().ready)


def test_all_motions_are_joined_without_a_jump(plan: PickPlacePlan) -> None:
    whole = joined(plan.motions)
    assert whole.duration == pytest.approx(sum(motion.trajectory.duration for motion in plan.motions))
    assert np.all(np.diff(whole.times) > 0.0)
    np.testing.assert_allclose(whole.start, plan.go_above.trajectory.start)
    np.testing.assert_allclose(whole.end, plan.retreat.trajectory.end)
    assert np.abs(np.diff(whole.positions, axis=0)).max() < 0.3
    closing = plan.go_above.trajectory.duration + plan.descend.trajectory.duration
    at = whole.positions[np.searchsorted(whole.times, closing - 1e-9)]
    np.testing.assert_allclose(at, plan.descend.trajectory.end, atol=1e-9)


def test_the_ways_end_where_the_hand_acts(planner: TransferPlanner, plan: PickPlacePlan) -> None:
    ways = paths(planner.model, plan.motions)
    assert [way.phase for way in ways] == [motion.phase for motion in plan.motions]
    down, lower = (next(way for way in ways if way.phase is phase) for phase in (Phase.DESCEND, Phase.LOWER))
    assert down.positions[-1] == pytest.approx([*plan.grasp.centroid[:2], plan.grasp.tcp_z], abs=2e-3)
    assert lower.positions[-1][:2] == pytest.approx([PLACE.x, PLACE.y], abs=2e-3)
    assert down.hand.held is None and lower.hand.held is not None, "the load is shown with the hand that carries it"
    for way in ways:
        shown = way.positions[way.hands()]
        assert np.array_equal(shown[[0, -1]], way.positions[[0, -1]])
        assert np.linalg.norm(np.diff(shown, axis=0), axis=1).max() < 0.1


def test_the_picture_shows_things_and_the_way(planner: TransferPlanner, plan: PickPlacePlan) -> None:
    grid = plan.go_above.scene.grid
    plain = picture(grid, [])
    assert plain.shape == (4 * grid.heights.shape[0], 4 * grid.heights.shape[1], 3) and plain.dtype == np.uint8
    row, col = (round(4 * (at - low) / grid.cell) for at, low in ((0.1, grid.y_min), (0.45, grid.x_min)))
    assert plain[row, col, 0] > plain[4, 4, 0] + 30, "the cube is lighter than the table"
    drawn = picture(grid, paths(planner.model, plan.motions))
    changed = np.argwhere((drawn != plain).any(axis=2))
    for pose in (PICK, PLACE):
        at = 4 * (pose.y - grid.y_min) / grid.cell, 4 * (pose.x - grid.x_min) / grid.cell
        assert np.abs(changed - at).sum(axis=1).min() < 8


def test_the_markers_name_the_plan(planner: TransferPlanner, plan: PickPlacePlan) -> None:
    pytest.importorskip("rclpy")
    from panda_executor.node_preview import preview_markers

    first, *markers = preview_markers("12ab34cd", paths(planner.model, plan.motions), "panda_link0").markers
    assert first.action == first.DELETEALL
    assert len({(marker.ns, marker.id) for marker in markers}) == len(markers)
    assert {marker.header.frame_id for marker in markers} == {"panda_link0"}
    [label] = [marker for marker in markers if marker.ns == "plan"]
    lines = [marker for marker in markers if marker.ns == "path"]
    end = lines[0].points[-1]
    at = label.pose.position
    assert label.text == "plan 12ab34cd"
    assert (at.x, at.y, at.z) == pytest.approx((end.x, end.y, end.z + 0.15)), "over the first motion's end"
    assert len(lines) == len(plan.motions) and all(len(line.points) >= 2 for line in lines)
    grasps = [marker for marker in markers if marker.ns == "grasp"]
    assert len(grasps) == 2
    assert all(min(marker.scale.x, marker.scale.y, marker.scale.z) > 0.01 for marker in grasps)
    high = np.array([marker.pose.position.z for marker in markers if marker.ns == "swept"])
    assert high.min() > 0.0 and high.max() < CAMERA[2]


def test_each_plan_is_shown_under_an_id_of_its_own(plan: PickPlacePlan) -> None:
    shown: list[tuple[str, object]] = []
    approvals = Approvals(1.0, show=lambda plan_id, motions: shown.append((plan_id, motions)))
    ids = [approvals.present(plan.motions) for _ in range(2)]
    assert shown == [(plan_id, plan.motions) for plan_id in ids] and ids[0] != ids[1]
