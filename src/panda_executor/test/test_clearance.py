"""The whole arm, its hand and its load against what was seen: plans are checked again with the shapes themselves."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull
from synthetic_clouds import CAMERA, Cube, cube_points, seen_cloud

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import PlanningError
from panda_executor.hand_geometry import HandShape, HeldObject
from panda_executor.ik import hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.reach_map import ReachMap, with_common_shadows, with_shadows
from panda_executor.scene import UnseenRule
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import FloatArray, load_preset

READY = load_preset().ready
FLOOR = 0.012


def closest(model: PandaModel, positions: FloatArray, box: Cube) -> float:
    """Return the distance [m] between the arm with its hand and a box, by their own shapes."""
    pin.forwardKinematics(model.model, model.data, positions)
    shape = coal.Box(*box.size)
    place = coal.Transform3s(pin.exp3(np.array([0.0, 0.0, box.yaw])), np.array([box.x, box.y, box.z + box.size[2] / 2]))
    nearest = np.inf
    for item in model.geometry.geometryObjects:
        if item.parentJoint == 0:
            continue
        at = model.data.oMi[item.parentJoint] * item.placement
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        coal.distance(item.geometry, coal.Transform3s(at.rotation, at.translation), shape, place, request, result)
        nearest = min(nearest, result.min_distance)
    return nearest


def least_distance(plan: PickPlacePlan, box: Cube) -> float:
    found = np.inf
    for motion in plan.motions:
        times = np.arange(0.0, motion.trajectory.duration, 0.05)
        for positions in motion.trajectory.sample(times)[0]:
            found = min(found, closest(motion.scene.model, positions, box))
    return found


def plan_before_a_box(planner: TransferPlanner, height: float, aside: float) -> tuple[PickPlacePlan, Cube]:
    """Plan to pick a cube in front of a box that the camera sees behind it, so much [m] to its side."""
    box = Cube(0.55 - 0.14 - 0.04, 0.1 + aside, size=(0.08, 0.12, height))
    cloud = seen_cloud(cube_points(Cube(0.55, 0.1, 0.3)), cube_points(box))
    action = PickPlaceAction(PlanarPose(0.55, 0.1, 0.3), PlanarPose(0.5, -0.25, 0.3))
    return planner.plan(action, cloud, WorkspaceSpec(), READY), box


def test_a_box_behind_the_pick_is_not_hit_by_the_arm(planner: TransferPlanner) -> None:
    plan, box = plan_before_a_box(planner, 0.15, 0.0)
    assert least_distance(plan, box) > planner.config.scene.arm_clearance


def test_a_box_that_the_arm_would_hit_is_not_planned_past(planner: TransferPlanner) -> None:
    """Only hand and load used to be checked: the forearm went through such a box."""
    with pytest.raises(PlanningError, match="no approach to the object is free"):
        plan_before_a_box(planner, 0.25, 0.09)


def test_what_rises_above_the_workspace_is_avoided(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    """A column of 0.45 m between pick and place, above the workspace's z_max, used to be dropped."""
    column = Cube(0.45, 0.0, size=(0.05, 0.05, 0.45))
    cloud = seen_cloud(cube_points(Cube(0.45, 0.2, 0.3)), cube_points(column, 0.003))
    action = PickPlaceAction(PlanarPose(0.45, 0.2, 0.3), PlanarPose(0.45, -0.2, 0.3))
    assert least_distance(planner.plan(action, cloud, workspace, READY), column) > 0.0


def test_spheres_hold_the_links(model: PandaModel) -> None:
    random = np.random.default_rng(0)
    for positions in (READY, READY + random.normal(0.0, 0.3, 7)):
        centres, radii = model.own_spheres(positions)
        for item in model.geometry.geometryObjects:
            if not hasattr(item.geometry, "points"):
                continue
            name = model.model.frames[item.parentFrame].name
            if "link" not in name:
                continue
            at = model.data.oMi[item.parentJoint] * item.placement
            corners = np.asarray(item.geometry.points())
            faces = corners[ConvexHull(corners).simplices]  # (M, 3, 3)
            points = np.einsum(
                "ni,nij->nj", random.dirichlet(np.ones(3), 400), faces[random.integers(len(faces), size=400)]
            )
            surface = np.concatenate([corners, points]) @ at.rotation.T + at.translation
            outside = np.linalg.norm(surface[:, None] - centres, axis=2) - radii
            assert outside.min(axis=1).max() <= 1e-9, name


def test_a_sphere_touches_a_column_where_geometry_says_so() -> None:
    heights = np.full((40, 40), -1.0)
    heights[20, 20] = 0.1  # at x, y 0.2..0.21
    radii = np.array([0.04])
    reach = ReachMap.over(heights, 0.0, 0.0, 0.01, radii, FLOOR)
    random = np.random.default_rng(1)
    centres = np.column_stack([random.uniform(0.1, 0.3, (4000, 2)), random.uniform(0.0, 0.2, 4000)])
    beside = np.maximum(np.abs(centres[:, :2] - 0.205) - 0.005, 0.0)
    above = np.maximum(centres[:, 2] - 0.1, 0.0)
    distance = np.sqrt((beside**2).sum(axis=1) + above**2)
    hits = reach.hits(centres, np.repeat(radii, len(centres)))
    assert hits[distance < 0.04].all(), "a touch was missed"
    assert not hits[distance > 0.04 + 2 * 0.01 * np.sqrt(2)].any(), "too careful"


def test_a_map_reaches_to_its_very_edges_and_no_further() -> None:
    heights = np.full((12, 9), 0.1)
    radii = np.array([0.03])
    reach = ReachMap.over(heights, 0.0, 0.0, 0.01, radii, FLOOR)
    edges = np.array([[0.001, 0.001], [0.089, 0.001], [0.001, 0.119], [0.089, 0.119]])
    beyond = np.array([[-0.001, 0.05], [0.091, 0.05], [0.05, -0.001], [0.05, 0.121]])
    for places, touches in ((edges, True), (beyond, False)):
        centres = np.column_stack([places, np.full(4, 0.05)])
        assert (reach.hits(centres, np.repeat(radii, 4)) == touches).all()


def test_unseen_space_behind_a_column_counts_as_filled_up_to_the_line_of_sight() -> None:
    heights, seen = np.full((3, 60), -1.0), np.ones((3, 60), dtype=bool)
    heights[1, 40] = 0.2
    seen[1, 20:40] = False  # behind it, as the camera at x = 1 sees it
    filled = with_shadows(heights, seen, 0.0, 0.0, 0.01, np.array([1.0, 0.015, 0.8]), FLOOR)
    shadow = filled[1, 20:40]
    assert shadow[-1] > 0.18 and (np.diff(shadow[shadow > 0]) > 0).all()
    assert (filled[seen] == heights[seen]).all(), "what was seen stays as it was seen"
    assert shadow[10] == pytest.approx(0.2 - 0.1 * (0.8 - 0.2) / (1.0 - 0.405), abs=0.015)


def test_a_second_camera_leaves_of_a_shadow_what_it_does_not_see_either() -> None:
    heights, seen = np.full((61, 61), -1.0), np.ones((61, 61), dtype=bool)
    heights[28:33, 40] = 0.2
    seen[28:33, 20:40] = False
    ahead, aside = np.array([1.0, 0.305, 0.8]), np.array([0.305, 1.2, 0.8])
    alone = with_shadows(heights, seen, 0.0, 0.0, 0.01, ahead, FLOOR)
    both = with_common_shadows(heights, seen, 0.0, 0.0, 0.01, (ahead, aside), FLOOR)
    np.testing.assert_array_equal(both, with_common_shadows(heights, seen, 0.0, 0.0, 0.01, (aside, ahead), FLOOR))
    assert (alone[28:33, 30] > FLOOR).all() and (both[28:33, 30] == -1.0).all(), "the other looks there past it"
    steep = np.array([0.99, 0.305, 3.0])
    lines = with_shadows(heights, seen, 0.0, 0.0, 0.01, steep, FLOOR)
    near = lines > heights
    assert near.any() and (lines[near] < alone[near]).all()
    np.testing.assert_array_equal(
        with_common_shadows(heights, seen, 0.0, 0.0, 0.01, (ahead, steep), FLOOR), lines, "the lowest line counts"
    )
    seen[28:33, 20:40] = True  # by either
    np.testing.assert_array_equal(with_common_shadows(heights, seen, 0.0, 0.0, 0.01, (ahead, aside), FLOOR), heights)


def test_a_column_that_is_higher_than_the_camera_has_no_shadow() -> None:
    heights, seen = np.full((3, 60), -1.0), np.zeros((3, 60), dtype=bool)
    heights[1, 40] = 0.85
    filled = with_shadows(heights, seen, 0.0, 0.0, 0.01, np.array([1.0, 0.015, 0.8]), FLOOR)
    np.testing.assert_array_equal(filled, heights)


@pytest.mark.parametrize("turned", [False, True])
def test_a_shadow_that_leaves_the_grid_does_not_come_in_at_its_other_side(turned: bool) -> None:
    heights, seen = np.full((3, 30), -1.0), np.zeros((3, 30), dtype=bool)
    heights[1, 3] = 0.3
    camera = np.array([1.0, 0.015, 0.8])
    if turned:
        heights, seen, camera = heights.T.copy(), seen.T.copy(), camera[[1, 0, 2]]
    filled = with_shadows(heights, seen, 0.0, 0.0, 0.01, camera, FLOOR)
    behind, far = (filled[:3, 1], filled[20:, 1]) if turned else (filled[1, :3], filled[1, 20:])
    assert (behind > 0.0).all() and (far == -1.0).all()


@pytest.mark.parametrize(("rule", "touches"), [(UnseenRule.FREE, False), (UnseenRule.SHADOW, True)])
def test_the_rule_for_unseen_space_is_a_setting(workspace: WorkspaceSpec, rule: UnseenRule, touches: bool) -> None:
    wall = np.stack(np.meshgrid([0.5, 0.502], np.arange(-0.1, 0.1, 0.002), [0.3]), -1).reshape(-1, 3)
    grid = ObstacleGrid.from_cloud(wall.astype(np.float32), workspace, FLOOR, cameras=(np.array([0.92, 0.0, 2.0]),))
    radii = np.array([0.05])
    behind = np.array([[0.42, 0.0, 0.2]])
    assert grid.reach(radii, FLOOR, rule is UnseenRule.SHADOW).hits(behind, radii).any() == touches


@pytest.mark.parametrize(("below", "what"), [(0.02, None), (0.4, "the camera post")])
def test_the_load_is_kept_from_the_post(
    planner: TransferPlanner, workspace: WorkspaceSpec, below: float, what: str | None
) -> None:
    """A long thing that sticks out of the hand towards the camera's post."""
    post, half = planner.model.fixed_boxes["camera post"]
    x = float(post[0] - half[0]) - 0.1
    assert x > 0.6 and (CAMERA[:2] == [0.92, 0.0]).all()
    cells = np.stack(np.meshgrid(np.arange(-0.15, 0.15, 0.01), np.arange(-0.15, 0.15, 0.01)), -1).reshape(-1, 2)
    reach = cells if what else cells[np.abs(cells).max(axis=1) < 0.02]
    held = HeldObject(reach, below=0.02, above=0.02)
    scene = planner.scene(ObstacleGrid.empty(workspace), HandShape(planner.config.hand, 0.04, held))
    rotation = hand_down_pose(x, 0.0, 0.3, 0.0).rotation
    planner.model.in_collision(READY)
    links = planner.model.reaching.placed(planner.model.data)
    found = scene._load_hits(np.asarray(rotation), np.array([x, 0.0, 0.3]), links)
    assert found == what


def test_no_point_of_a_load_that_touches_is_passed_over(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    """What is far from the load is left out before its points are compared: that must change no answer."""
    random = np.random.default_rng(0)
    held = HeldObject(random.uniform(-0.05, 0.12, (60, 2)), below=0.15, above=0.02)  # off the tcp's axis
    hand = HandShape(planner.config.hand, 0.04, held)
    scene = planner.scene(ObstacleGrid.empty(workspace), hand)
    model, clearance = planner.model, planner.config.scene.load_clearance
    ball, radius = hand.load_ball
    assert (np.linalg.norm(hand.load - ball, axis=1) <= radius).all() and radius < 0.2
    centre, _ = model.fixed_boxes["camera"]
    found = []
    for number in range(300):
        rotation = pin.exp3(random.normal(size=3))
        links = model.own_spheres(READY)[0][len(model.standing.radii) :]
        near = (
            centre + random.uniform(-0.3, 0.3, 3) if number % 2 else random.uniform([0.0, -0.2, 0.1], [0.5, 0.2, 0.6])
        )
        points = hand.load @ rotation.T + near
        expected = any(
            bool((np.abs(points - box) < size).all(axis=1).any())
            for name, (box, size) in model.fixed_boxes.items()
            if name != "table"
        )
        for cover, centres in ((model.standing, model.standing.placed(model.data)), (model.reaching, links)):
            counted = cover.joints < 5
            reach = cover.radii[counted] + clearance
            expected |= bool((np.linalg.norm(points[:, None] - centres[counted], axis=2) < reach).any())
        found.append(scene._load_hits(rotation, near, links) is not None)
        assert found[-1] == expected
    assert 30 < sum(found) < 270


def test_what_is_not_valid_has_a_problem_and_the_other_way_round(
    planner: TransferPlanner, workspace: WorkspaceSpec
) -> None:
    """`is_valid` reads the kinematics that the collision check left, `problem` computes them anew."""
    random = np.random.default_rng(0)
    held = HeldObject(random.uniform(-0.03, 0.03, (30, 2)), below=0.03, above=0.02)
    cloud = np.concatenate([cube_points(Cube(x, y, size=(0.06, 0.06, 0.25))) for x, y in ((0.45, 0.2), (0.5, -0.2))])
    grid = ObstacleGrid.from_cloud(cloud.astype(np.float32), workspace, FLOOR)
    scene = planner.scene(grid, HandShape(planner.config.hand, 0.04, held))
    found = []
    for _ in range(400):
        positions = READY + random.normal(scale=0.4, size=7)
        found.append(scene.is_valid(positions))
        assert found[-1] == (scene.problem(positions) is None)
    assert 40 < sum(found) < 390


def test_the_load_is_kept_from_the_arm(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    cells = np.stack(np.meshgrid(np.arange(-0.3, 0.3, 0.01), [0.0]), -1).reshape(-1, 2)
    held = HeldObject(np.concatenate([cells, cells[:, ::-1]]), below=0.02, above=0.02)
    scene = planner.scene(ObstacleGrid.empty(workspace), HandShape(planner.config.hand, 0.04, held))
    positions = planner.ik.solve_all(hand_down_pose(0.28, 0.0, 0.2, 0.0), READY)[0].positions
    assert scene.problem(positions) == "what is held would touch the arm"
    assert scene.with_hand(HandShape(planner.config.hand, 0.04)).problem(positions) is None


def test_the_arm_itself_is_not_an_obstacle(planner: TransferPlanner, workspace: WorkspaceSpec) -> None:
    """It waits in its own camera's view; what stands beside it stays."""
    centres, radii = planner.model.own_spheres(READY)
    random = np.random.default_rng(0)
    rays = random.normal(size=(len(centres), 30, 3))
    rays /= np.linalg.norm(rays, axis=2)[:, :, None]
    skin = (centres[:, None] + radii[:, None, None] * rays).reshape(-1, 3)
    beside = cube_points(Cube(0.45, 0.2, size=(0.05, 0.05, 0.5)))
    left = planner.surroundings(np.concatenate([skin, beside]).astype(np.float32), workspace, READY)
    assert len(left) == len(beside)


@pytest.mark.parametrize("width", [None, 0.03])
def test_the_hand_is_as_wide_to_either_side(planner: TransferPlanner, width: float | None) -> None:
    hand = planner.config.hand
    shape = HandShape(hand, width)
    boxes = np.array([[box.lower, box.upper] for box in shape.boxes()])  # (boxes, 2, xyz)
    surfaces = np.concatenate([box.grown(0.0).surface() for box in shape.boxes()])
    np.testing.assert_array_equal(shape.points, np.unique(np.round(surfaces, 5), axis=0))
    assert (boxes[:, 0] < boxes[:, 1]).all(), "every box has a volume"
    for extent in (shape.points, boxes.reshape(-1, 3)):
        assert extent[:, :2].min(axis=0) == pytest.approx(-extent[:, :2].max(axis=0))
    assert boxes[..., 1].max() == pytest.approx(hand.palm_half_length)
