"""Paths round obstacles, and plans that hold when every centimetre is checked again."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_clouds import (
    Bowl,
    Cube,
    cloud_of,
    container_points,
    cube_points,
    ring_points,
    seen_cloud,
)
from walls import above

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.approaches import Target, more_approaches, usual_approaches
from panda_executor.budget import Budget
from panda_executor.config import SearchConfig
from panda_executor.drag import plan_drag
from panda_executor.errors import GraspError, PlanningError
from panda_executor.ik import hand_down_pose, yaw_of_hand
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import BORDER, ObstacleGrid
from panda_executor.path_search import find_path, line_is_free
from panda_executor.phase import Phase
from panda_executor.scene import Scene
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan, TransferAttempts
from panda_model import load_preset

READY_POSITIONS = load_preset().ready


def check_densely(motion: Motion) -> None:
    """Walk the interpolated trajectory in steps below 1 cm and 0.02 rad; every one must be free."""
    scene, trajectory = motion.scene, motion.trajectory
    count = 50
    while True:
        positions = trajectory.sample(np.linspace(0.0, trajectory.duration, count))[0]
        tcp = np.array([scene.model.tcp_arrays(q)[1] for q in positions])
        tcp_step = np.linalg.norm(np.diff(tcp, axis=0), axis=1).max()
        if tcp_step <= 0.01 and np.abs(np.diff(positions, axis=0)).max() <= 0.02:
            break
        count *= 2
    for q in positions:
        assert scene.problem(q) is None, f"{motion.phase.name}: {scene.problem(q)}"


def test_a_wall_is_gone_round(planner: TransferPlanner, walled: Scene) -> None:
    start, goal = (above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2))
    assert not line_is_free(walled, start, goal)
    motion = planner.motions.travel(Phase.CARRY, start, goal, walled)
    np.testing.assert_allclose(motion.trajectory.start, start)
    np.testing.assert_allclose(motion.trajectory.end, goal)
    check_densely(motion)


def test_another_way_down_at_the_place_is_tried_where_the_first_leads_nowhere(
    planner: TransferPlanner, workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    joined, tried = TransferAttempts._joined, []

    def second_only(attempts: TransferAttempts, attempt: object, pick: object, place: object) -> object:
        tried.append((pick, place))
        if len(tried) == 1:
            raise PlanningError("no way from there")
        return joined(attempts, attempt, pick, place)  # type: ignore[arg-type]

    monkeypatch.setattr(TransferAttempts, "_joined", second_only)
    action = PickPlaceAction(PlanarPose(0.45, 0.1, 0.0), PlanarPose(0.5, -0.1, 0.0))
    planner.plan(action, cloud_of([Cube(0.45, 0.1)]), workspace, READY_POSITIONS)
    (first_pick, first_place), (pick, place) = tried
    assert pick is first_pick and place is not first_place


def test_the_hand_leans_only_where_it_cannot_go_down_upright(planner: TransferPlanner, free_scene: Scene) -> None:
    target = Target(0.5, 0.1, 0.02, 0.2, 0.0)
    found = list(usual_approaches(planner.motions, Phase.DESCEND, target, free_scene, READY_POSITIONS))
    assert len(found) > 1
    for approach in found:
        assert planner.model.tcp_pose(approach.above).rotation[2, 2] == pytest.approx(-1.0, abs=1e-6)


def test_more_ways_down_end_on_the_pose_from_each_height_and_are_distinct(
    planner: TransferPlanner, free_scene: Scene
) -> None:
    target = Target(0.5, 0.1, 0.02, 0.2, 0.0)
    found = list(more_approaches(planner.motions, Phase.DESCEND, target, free_scene, READY_POSITIONS))
    usual = list(usual_approaches(planner.motions, Phase.DESCEND, target, free_scene, READY_POSITIONS))
    assert len(found) > 2 * len(usual)
    heights = []
    for approach in found:
        check_densely(approach.down)
        np.testing.assert_array_equal(approach.down.trajectory.start, approach.above)
        end = planner.model.tcp_pose(approach.down.trajectory.end)
        assert end.is_close(hand_down_pose(0.5, 0.1, 0.02, 0.0), 1e-4)
        heights.append(round(float(planner.model.tcp_pose(approach.above).translation[2]), 3))
    assert [height for height, _ in itertools.groupby(heights)] == [0.2, 0.15, 0.28, 0.38]


def test_a_straight_motion_of_a_millimetre_has_a_point_between_its_ends(planner: TransferPlanner) -> None:
    start = above(planner, 0.5, 0.1, 0.2)
    points = planner.motions.cartesian_waypoints(start, hand_down_pose(0.5, 0.1, 0.199, 0.0))
    assert points is not None and len(points) == 3


def test_a_straight_motion_keeps_to_its_line(planner: TransferPlanner, free_scene: Scene) -> None:
    start = above(planner, 0.5, 0.1, 0.2)
    motion = planner.motions.straight(Phase.DESCEND, start, hand_down_pose(0.5, 0.1, 0.02, 0.0), free_scene)
    assert motion is not None
    times = np.linspace(0.0, motion.trajectory.duration, 100)
    tcp = np.array([planner.model.tcp_arrays(q)[1] for q in motion.trajectory.sample(times)[0]])
    assert np.linalg.norm(tcp[:, :2] - [0.5, 0.1], axis=1).max() < 0.002
    assert tcp[-1, 2] == pytest.approx(0.02, abs=1e-4)
    back = planner.motions.reversed(Phase.RAISE, motion, free_scene).trajectory
    for a, b in zip(back.sample(motion.trajectory.duration - times)[:3], motion.trajectory.sample(times)[:3]):
        np.testing.assert_allclose(np.abs(a), np.abs(b), atol=1e-6)


@pytest.mark.parametrize(("speed", "elsewhere"), [(None, 1.0), (0.1, 1.0), (None, 0.08), (0.25, 0.08)])
def test_a_straight_motion_near_things_is_slow(
    planner: TransferPlanner,
    free_scene: Scene,
    speed: float | None,
    elsewhere: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And never faster than the arm may be elsewhere."""
    assert planner.config.timing.tcp_speed_near <= 0.25 < planner.config.timing.tcp_speed
    timing = replace(planner.config.timing, tcp_speed=elsewhere)
    monkeypatch.setattr(planner.motions, "config", replace(planner.config, timing=timing))
    start = above(planner, 0.5, 0.1, 0.35)
    motion = planner.motions.straight(Phase.DESCEND, start, hand_down_pose(0.5, 0.1, 0.02, 0.0), free_scene, speed)
    assert motion is not None
    times = np.linspace(0.0, motion.trajectory.duration, 400)
    tcp = np.array([planner.model.tcp_arrays(q)[1] for q in motion.trajectory.sample(times)[0]])
    fastest = float((np.linalg.norm(np.diff(tcp, axis=0), axis=1) / np.diff(times)).max())
    limit = min(timing.tcp_speed_near if speed is None else speed, elsewhere)
    assert 0.8 * limit < fastest < 1.02 * limit


def test_a_straight_motion_into_the_table_is_none(planner: TransferPlanner, free_scene: Scene) -> None:
    start = above(planner, 0.5, 0.1, 0.2)
    assert planner.motions.straight(Phase.DESCEND, start, hand_down_pose(0.5, 0.1, -0.01, 0.0), free_scene) is None


def scene_of(seed: int) -> tuple[np.ndarray, PickPlaceAction]:
    """Two cubes and a bowl far enough apart; the first cube is to go into the bowl."""
    random = np.random.default_rng(seed)
    spots: list[np.ndarray] = []
    while len(spots) < 3:
        spot = random.uniform([0.3, -0.32], [0.6, 0.32])
        if all(np.linalg.norm(spot - other) > 0.13 for other in spots):
            spots.append(spot)
    yaws = random.uniform(-math.pi, math.pi, 2)
    cubes = [Cube(float(x), float(y), float(yaw)) for (x, y), yaw in zip(spots[:2], yaws, strict=True)]
    bowl = Bowl(float(spots[2][0]), float(spots[2][1]))
    pick = PlanarPose(cubes[0].x, cubes[0].y, cubes[0].yaw)
    return cloud_of(cubes, [bowl], 0.001, seed), PickPlaceAction(pick, PlanarPose(bowl.x, bowl.y, float(yaws[1])))


@pytest.mark.parametrize("seed", range(8))
def test_plans_hold_when_checked_densely(planner: TransferPlanner, workspace: WorkspaceSpec, seed: int) -> None:
    cloud, action = scene_of(seed)
    plan = planner.plan(action, cloud, workspace, READY_POSITIONS)
    here = READY_POSITIONS
    for motion in plan.motions:
        np.testing.assert_allclose(motion.trajectory.start, here, atol=1e-6)
        check_densely(motion)
        here = motion.trajectory.end
    np.testing.assert_allclose(here, planner.ready, atol=1e-6)
    check_ends(planner, action, plan)


@pytest.mark.parametrize("seed", range(10))
def test_a_bowl_is_not_touched_wherever_the_object_goes_in(
    planner: TransferPlanner, workspace: WorkspaceSpec, seed: int
) -> None:
    random = np.random.default_rng(seed)
    x, y = np.array([0.5, -0.2]) + random.uniform(-0.02, 0.02, 2)
    cloud = cloud_of([Cube(0.45, 0.1)], [Bowl(0.5, -0.2)])
    place = PlanarPose(float(x), float(y), float(random.uniform(-math.pi, math.pi)))
    plan = planner.plan(PickPlaceAction(PlanarPose(0.45, 0.1, 0.0), place), cloud, workspace, READY_POSITIONS)
    bowl = ObstacleGrid.from_cloud(cloud_of([], [Bowl(0.5, -0.2)]), workspace, 0.012)
    for motion in (plan.lower, plan.leave):
        for positions in motion.trajectory.positions:
            assert not bowl.hits(planner.model.tcp_pose(positions).apply(motion.scene.hand.points)).any()
    assert planner.model.tcp_pose(plan.lower.trajectory.end).translation[2] < 0.09  # not let fall from on high


def test_a_ring_goes_from_peg_to_peg(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    x, pegs = 0.45, (-0.12, 0.0, 0.12)
    things = [cube_points(Cube(x, y, size=(0.12, 0.12, 0.01))) for y in pegs]
    things += [ring_points(x, y, 0.01, 0.005, 0.0, 0.03) for y in pegs]
    things += [ring_points(x, pegs[0], 0.01, 0.035), ring_points(x, pegs[0], 0.03, 0.03)]
    action = PickPlaceAction(PlanarPose(x, pegs[0], 0.0), PlanarPose(x, pegs[2], 0.4))
    plan = planner.plan(action, seen_cloud(*things), workspace, READY_POSITIONS)
    for motion in plan.motions:
        check_densely(motion)
    underside = plan.placement.tcp_z - (plan.grasp.tcp_z - plan.grasp.support_z)
    assert underside < 0.02  # let go around the peg, not above it


def test_a_box_goes_between_walls_and_another(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    """10 mm to three walls and to a box: the hand goes no deeper than it must and holds the box near its top."""
    x, y = 0.45, -0.2
    other = cube_points(Cube(x - 0.04, y, size=(0.05, 0.1, 0.05), z=0.002))
    box = cube_points(Cube(0.45, 0.2, 0.3, (0.07, 0.1, 0.05)))
    cloud = seen_cloud(container_points(x, y, 0.152, 0.122), other, box)
    action = PickPlaceAction(PlanarPose(0.45, 0.2, 0.3), PlanarPose(x + 0.03, y, 0.0))
    plan = planner.plan(action, cloud, workspace, READY_POSITIONS)
    for motion in plan.motions:
        check_densely(motion)
    underside = plan.placement.tcp_z - (plan.grasp.tcp_z - plan.grasp.support_z)
    assert 0.002 < underside < 0.022


def check_ends(planner: TransferPlanner, action: PickPlaceAction, plan: PickPlacePlan) -> None:
    """The hand stops at the grasp and at the place, pointing down, turned as asked."""
    pick = planner.model.tcp_pose(plan.descend.trajectory.end)
    place = planner.model.tcp_pose(plan.lower.trajectory.end)
    for pose in (pick, place):
        assert pose.rotation[2, 2] == pytest.approx(-1.0, abs=1e-5)
    np.testing.assert_allclose(pick.translation, [*plan.grasp.centroid[:2], plan.grasp.tcp_z], atol=1e-4)
    np.testing.assert_allclose(place.translation[:2], [action.place.x, action.place.y], atol=1e-4)
    turned = yaw_of_hand(place) - yaw_of_hand(pick) - (action.place.yaw - action.pick.yaw)
    assert math.cos(turned) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("centred", [True, False])
def test_a_pick_beside_the_middle_is_centred_or_its_offset_kept(
    planner: TransferPlanner, workspace: WorkspaceSpec, table_cloud: np.ndarray, centred: bool
) -> None:
    """The cube's middle goes to the place, or as far from it as the pick was off, turned with the cube."""
    pick, place = PlanarPose(0.45, 0.109, 0.2), PlanarPose(0.5, -0.2, 0.9)
    hand = TransferPlanner(planner.model, replace(planner.config, centre_grasp=centred))
    plan = hand.plan(PickPlaceAction(pick, place), table_cloud, workspace, READY_POSITIONS)
    middle = PlanarPose(float(plan.grasp.centroid[0]), float(plan.grasp.centroid[1]), pick.yaw)
    assert math.hypot(middle.x - pick.x, middle.y - pick.y) > 0.006
    goes_to = place if centred else place @ pick.inverse() @ middle
    end = planner.model.tcp_pose(plan.lower.trajectory.end)
    np.testing.assert_allclose(end.translation[:2], [goes_to.x, goes_to.y], atol=1e-4)


def test_no_plan_has_a_reason(planner: TransferPlanner, workspace: WorkspaceSpec, table_cloud: np.ndarray) -> None:
    action = PickPlaceAction(PlanarPose(0.6, 0.3, 0.0), PlanarPose(0.5, -0.2, 0.0))
    with pytest.raises(GraspError, match="nothing rises"):
        planner.plan(action, table_cloud, workspace, READY_POSITIONS)


def test_a_place_under_a_tower_is_refused(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    towers = [Cube(0.45 + dx, -0.2 + dy, size=(0.04, 0.04, 0.2)) for dx in (-0.06, 0.06) for dy in (-0.06, 0.06)]
    action = PickPlaceAction(PlanarPose(0.45, 0.15, 0.0), PlanarPose(0.45, -0.2, 0.0))
    with pytest.raises(PlanningError, match="no room for hand and object at the place") as caught:
        planner.plan(action, cloud_of([Cube(0.45, 0.15), *towers]), workspace, READY_POSITIONS)
    assert "\n" not in str(caught.value)


def test_planning_ends_when_its_time_is_up(model, workspace: WorkspaceSpec, table_cloud: np.ndarray) -> None:
    late = TransferPlanner(model, clock=iter(range(0, 1000, 100)).__next__)
    action = PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3))
    with pytest.raises(PlanningError, match="planning took too long"):
        late.plan(action, table_cloud, workspace, READY_POSITIONS)


class StopsAfter:
    """A stop that is asked for at the n-th look."""

    def __init__(self, looks: int) -> None:
        self.left, self.after = looks, 0

    def __call__(self) -> bool:
        self.left -= 1
        self.after += self.left < 0
        return self.left < 0


@pytest.mark.parametrize("looks", [1, 4, 8])
def test_planning_looks_at_stop_all_the_time(
    planner: TransferPlanner, workspace: WorkspaceSpec, table_cloud: np.ndarray, looks: int
) -> None:
    stop = StopsAfter(looks)
    action = PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3))
    with pytest.raises(PlanningError, match="planning was stopped"):
        planner.plan(action, table_cloud, workspace, READY_POSITIONS, should_stop=stop)
    assert stop.after < 10, "it went on for long"


@pytest.mark.parametrize("looks", [2, 30, 300])
def test_a_search_looks_at_stop_all_the_time(planner: TransferPlanner, walled: Scene, looks: int) -> None:
    start, goal = (above(planner, 0.5, y, 0.08) for y in (-0.2, 0.2))
    stop = StopsAfter(looks)
    with pytest.raises(PlanningError, match="planning was stopped"):
        find_path(walled, start, goal, SearchConfig(time_limit=60.0), budget=Budget(should_stop=stop))
    assert stop.after < 50, "it went on for long"


def test_planning_is_bounded_across_branches(model, planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    """The clock goes on a little at every look: the bound holds within a grasp's many branches and searches."""
    looks = iter(range(10**9))
    config = replace(planner.config, planning_time=0.2)
    hurried = TransferPlanner(model, config, clock=lambda: next(looks) * 0.01)
    towers = [cube_points(Cube(0.45, y, size=(0.3, 0.02, 0.15))) for y in (-0.03, 0.03)]
    action = PickPlaceAction(PlanarPose(0.45, 0.2, 0.3), PlanarPose(0.45, -0.2, 0.3))
    with pytest.raises(PlanningError, match=r"took too long \(at most 0.2 s\)"):
        hurried.plan(action, seen_cloud(cube_points(Cube(0.45, 0.2, 0.3)), *towers), workspace, READY_POSITIONS)
    assert next(looks) < 60


@pytest.mark.parametrize("primitive", [Primitive.SWEEP, Primitive.FOLD])
def test_a_drag_follows_the_table(planner: TransferPlanner, workspace: WorkspaceSpec, primitive: Primitive) -> None:
    action = PickPlaceAction(PlanarPose(0.45, -0.1, 0.0), PlanarPose(0.5, 0.1, 0.5), primitive)
    plan = plan_drag(planner, action, cloud_of([Cube(0.46, 0.0)]), workspace, READY_POSITIONS)
    for motion in (plan.go_above, plan.descend, plan.drag, plan.leave, plan.retreat):
        check_densely(motion)
    tcp = np.array([planner.model.tcp_arrays(q)[1] for q in plan.drag.trajectory.positions])
    assert np.ptp(tcp[:, 2]) < 0.002
    np.testing.assert_allclose(tcp[[0, -1], :2], [[0.45, -0.1], [0.5, 0.1]], atol=1e-4)
    assert plan.opening == (0.0 if primitive is Primitive.SWEEP else planner.config.hand.fold_opening)
    assert (plan.lift is None) == (primitive is Primitive.SWEEP)


def test_a_drag_stops_at_something_tall(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    action = PickPlaceAction(PlanarPose(0.45, -0.15, 0.0), PlanarPose(0.45, 0.15, 0.0), Primitive.SWEEP)
    cloud = cloud_of([Cube(0.45, 0.0, size=(0.04, 0.04, 0.15))])
    with pytest.raises(PlanningError, match="sweep from the pick to the place"):
        plan_drag(planner, action, cloud, workspace, READY_POSITIONS)


def test_columns_hold_what_was_seen(workspace: WorkspaceSpec) -> None:
    cloud = np.array([[0.452, 0.102, 0.05], [0.452, 0.102, 0.03], [0.502, 0.002, 0.1], [np.nan] * 3, [0.6, 0.0, 0.005]])
    grid = ObstacleGrid.from_cloud(cloud.astype(np.float32), workspace, 0.012)
    inside = np.array(
        [[0.452, 0.102, 0.02], [0.452, 0.102, 0.06], [0.502, 0.002, 0.02], [0.6, 0.0, 0.001], [9.0, 9.0, 0.0]]
    )
    np.testing.assert_array_equal(grid.hits(inside), [True, False, False, False, False])  # one point is no object
    assert not grid.without(inside).hits(inside).any()
    assert grid.heights.shape == ObstacleGrid.empty(workspace).heights.shape
    assert grid.x_min == workspace.x_min - BORDER
