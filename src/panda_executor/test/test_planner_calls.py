"""What the planner takes for the arm itself, and what it hands on to the parts that plan."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import transfer
from panda_executor.budget import Budget
from panda_executor.config import ExecutorConfig
from panda_executor.errors import BudgetSpentError, PlanningError
from panda_executor.grasp import Grasp
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.scene import SceneConfig
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray, load_preset

READY = load_preset().ready
SPACE = WorkspaceSpec(x_min=0.2, x_max=0.5, y_min=0.1, y_max=0.5, z_min=0.0, z_max=0.25, pixel_size=0.0025)
ACTION = PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.8))
Patch = pytest.MonkeyPatch


def noted(asked: list[Any], given: Any, answer: Any = None) -> Any:
    """Write down what was asked and answer it."""
    asked.append(given)
    return answer


@pytest.fixture
def own(planner: TransferPlanner) -> TransferPlanner:
    """A planner with settings of its own and a clock that stands; the arm is the shared one."""
    scene = SceneConfig(table_z=0.02, own_margin=0.025, floor=0.015, grid_cell=0.01)
    config = replace(ExecutorConfig(), scene=scene, approach_height=0.11, planning_time=3.0, follow_from=0.005)
    return TransferPlanner(planner.model, config, clock=lambda: 7.0)


@pytest.mark.parametrize("seed", range(8))
def test_the_arm_in_its_cameras_view_is_left_out_and_nothing_else(
    own: TransferPlanner, monkeypatch: Patch, seed: int
) -> None:
    """Every point is compared with every sphere and, over the workspace, with the boxes of the open hand."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform((0.0, 0.15, 0.05 + 0.03 * seed), (0.6, 0.45, 0.4), (5, 3))
    radii = rng.uniform(0.02, 0.05, 5)
    pose = hand_down_pose(0.35, 0.3, 0.2 + 0.02 * seed, 0.4 * seed)
    rotation, translation = np.asarray(pose.rotation), np.asarray(pose.translation)
    monkeypatch.setattr(own.model, "own_spheres", lambda positions: (centres, radii))
    monkeypatch.setattr(own.model, "tcp_arrays", lambda positions: (rotation, translation))
    cloud = rng.uniform((-0.1, -0.1, -0.05), (0.8, 0.75, 0.5), (6000, 3)).astype(np.float32)
    cloud[::50] = np.nan
    boxes = [box.grown(0.025) for box in HandShape(own.config.hand).boxes()]
    kept, arm, hand = [], 0, 0
    for point in cloud:
        x, y, z = point.astype(np.float64)
        if not (0.08 < x < 0.62 and -0.02 < y < 0.62 and z > -0.02):
            continue
        in_arm = z > 0.035 and any(math.dist((x, y, z), c) < r + 0.025 for c, r in zip(centres, radii, strict=True))
        at = rotation.T @ (np.array([x, y, z]) - translation)
        in_hand = z > 0.25 and any((at > box.lower).all() and (at < box.upper).all() for box in boxes)
        arm, hand = arm + in_arm, hand + in_hand
        if not in_arm and not in_hand:
            kept.append(point)
    np.testing.assert_array_equal(own.surroundings(cloud, SPACE, READY), np.array(kept))
    assert arm > 30 and hand > 30
    assert len(own.surroundings(cloud[:0], SPACE, READY)) == 0


def test_spheres_hold_points_up_to_their_surface() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (3000, 3)).astype(np.float32)
    centres, radii = rng.uniform(-0.5, 0.5, (4, 3)), rng.uniform(0.05, 0.3, 4)
    distance = np.linalg.norm(points.astype(np.float64)[:, None] - centres, axis=2)
    np.testing.assert_array_equal(transfer._within(points, centres, radii), (distance < radii).any(axis=1))
    assert not transfer._within(points, centres[:0], radii[:0]).any()


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_camera_is_placed_anew_where_it_moved(
    own: TransferPlanner, monkeypatch: Patch, axis: int, side: float
) -> None:
    placed: list[list[float]] = []
    monkeypatch.setattr(transfer, "place_camera", lambda model, config, at, number: placed.append([number, *at]))
    at, shift = np.array([0.9, 0.1, 0.8]), side * np.eye(3)[axis]
    for step in (0.0, 0.9e-4, 1.1e-4, 1.0e-4):
        own.place_cameras(at + step * shift)
    np.testing.assert_array_equal(placed, [[1, *at], [1, *(at + 1.1e-4 * shift)]])
    other = np.array([0.1, -0.9, 0.7])
    own.place_cameras(at, other)
    own.place_cameras(at, other + 2e-4)
    np.testing.assert_array_equal(placed[2:], [[1, *at], [2, *other], [2, *(other + 2e-4)]])
    at[:] = 0.0
    np.testing.assert_array_equal(own._cameras, [row[1:] for row in (placed[2], placed[4])])


def test_the_columns_are_those_of_the_cloud_without_the_hands(own: TransferPlanner, monkeypatch: Patch) -> None:
    rng = np.random.default_rng(1)
    positions = own.ik.solve_all(hand_down_pose(0.35, 0.3, 0.1, 0.3), READY)[0].positions
    cloud = rng.uniform((0.1, 0.0, 0.0), (0.6, 0.6, 0.12), (20000, 3)).astype(np.float32)
    camera = np.array([1.2, 0.0, 0.9])
    monkeypatch.setattr(transfer, "place_camera", lambda model, config, at, number: None)  # the model is shared
    own.place_cameras(camera)
    seen = own.surroundings(cloud, SPACE, positions)
    rotation, translation = own.model.tcp_arrays(positions)
    hand = HandShape(own.config.hand, margin=0.015).points @ rotation.T + translation
    expected = ObstacleGrid.from_cloud(seen, SPACE, 0.02 + 0.015, 0.01, (camera,)).without(hand)
    grid = own.grid(cloud, SPACE, positions)
    np.testing.assert_array_equal(grid.heights, expected.heights)
    assert grid.cell == 0.01 and [at.tolist() for at in grid.cameras] == [camera.tolist()]
    assert 50 < (grid.heights < 0).sum() < grid.heights.size - 50


def test_the_ways_out_begin_without_the_columns_round_the_hand(own: TransferPlanner, monkeypatch: Patch) -> None:
    asked: list[tuple[Any, ...]] = []
    monkeypatch.setattr(own.motions, "travel", lambda *given: asked.append(given))
    monkeypatch.setattr(own.motions, "straight", lambda *given: asked.append(given))
    start = own.ik.solve_all(hand_down_pose(0.35, 0.3, 0.1, 0.3), READY)[0].positions
    grid = ObstacleGrid(np.full((60, 50), 0.14), 0.1, 0.0, 0.01)
    hand = HandShape(own.config.hand, 0.03)
    own.homeward(start, grid, hand)
    own.upward(start, grid, hand)
    home, up = asked
    assert (home[0], up[0]) == (Phase.RETREAT, Phase.RECOVERING)
    np.testing.assert_array_equal([home[1], home[2], up[1]], [start, own.model.arm.ready, start])
    here = own.model.tcp_pose(start)
    np.testing.assert_array_equal(up[2].rotation, here.rotation)
    np.testing.assert_allclose(up[2].translation - here.translation, [0.0, 0.0, 0.11], atol=1e-12)
    expected = own.scene(grid.without(own._hand_at(start)), hand).escaping(start)
    for scene in (home[3], up[3]):
        np.testing.assert_array_equal(scene.grid.heights, expected.grid.heights)
        assert scene.hand is hand and scene.table_z == expected.table_z


def test_a_request_has_the_configured_time_by_the_planners_clock(own: TransferPlanner) -> None:
    now, stop = [7.0], [False]
    own.clock = lambda: now[0]
    budget = own.budget(lambda: stop[0])
    now[0] = 10.0
    assert not budget.is_spent() and own.motions_within(budget).budget is budget
    now[0] = 10.01
    assert budget.is_spent()
    now[0], stop[0] = 7.0, True
    assert budget.is_spent() and not own.budget().is_spent()


@pytest.mark.parametrize(("costs", "flips"), [((1.0, 2.0), [0, 1]), ((2.0, 1.0), [1, 0]), ((1.0, 1.0), [0, 1])])
def test_the_gripper_is_turned_the_way_that_costs_the_arm_less(
    own: TransferPlanner, monkeypatch: Patch, costs: tuple[float, float], flips: list[int]
) -> None:
    grasp: Any = SimpleNamespace(centroid=np.array([0.4, 0.2, 0.05]), tcp_z=0.03, yaw=0.5)

    def near_cost(pose: Any, start: FloatArray) -> float:
        assert start is READY
        turned = [pose.is_close(hand_down_pose(0.4, 0.2, 0.03, 0.5 + flip)) for flip in (0.0, math.pi)]
        return costs[turned.index(True)]

    monkeypatch.setattr(own.ik, "near_cost", near_cost)
    assert own._flips(grasp, READY) == [flip * math.pi for flip in flips]


class Thing:
    """A grasp that covers every point with y below 0.3, and is known by its name."""

    highest_z = 0.1
    centroid = np.array([0.4, 0.2, 0.05])

    def __init__(self, name: str) -> None:
        self.name = name

    def covers(self, points: np.ndarray, margin: float) -> np.ndarray:
        assert margin == 0.008
        return np.asarray(points[:, 1] < 0.3)

    owns = Grasp.owns


@pytest.fixture
def tries(own: TransferPlanner, monkeypatch: Patch) -> list[tuple[Any, ...]]:
    """The attempts that `own` makes with two grasps, each of which fails with words of its own."""
    made: list[tuple[Any, ...]] = []

    class Attempts:
        def __init__(self, motions: Any, *given: Any) -> None:
            self.given = (motions.budget, *given)
            self.workspace, self.start = given[1], given[3]
            self.begun: list[str] = []

        def plan(self, grasp: Thing, flip: float, rest: np.ndarray, rest_grid: ObstacleGrid) -> Any:
            made.append((grasp.name, flip, rest, rest_grid, self.given))
            self.begun.append(f"{grasp.name}, {flip:.0f}")
            return outcome(len(made))

        def plan_from_anywhere(self, attempt: str) -> Any:
            made.append((f"again {attempt}",))
            return outcome(len(made))

    def outcome(count: int) -> Any:
        found = own.__dict__.get("outcomes", {}).get(count, PlanningError(f"reason {count}"))
        if isinstance(found, Exception):
            raise found
        return found

    monkeypatch.setattr(transfer, "TransferAttempts", Attempts)
    grasps = [Thing("a"), Thing("b")]
    monkeypatch.setattr(transfer, "plan_grasps", lambda *given: noted(made, ("grasps", *given), grasps))
    monkeypatch.setattr(own, "_flips", lambda grasp, start: [0.0, math.pi])
    made.clear()
    return made


def drawn_cloud() -> np.ndarray:
    rng = np.random.default_rng(2)
    return rng.uniform((0.15, 0.05, 0.0), (0.55, 0.6, 0.4), (9000, 3)).astype(np.float32)


def test_every_grasp_is_tried_either_way_among_the_rest_of_the_cloud(
    own: TransferPlanner, tries: list[tuple[Any, ...]]
) -> None:
    cloud, phases = drawn_cloud(), list[tuple[Phase, float]]()
    with pytest.raises(PlanningError, match=r"^reason 2$"):  # the first, that for grasps was no attempt
        own.plan(ACTION, cloud, SPACE, READY, on_phase=lambda phase, share: phases.append((phase, share)))
    grasps, *attempts = tries[:5]
    assert tries[5:] == [("again a, 0",), ("again a, 3",), ("again b, 0",), ("again b, 3",)]
    around = own.surroundings(cloud, SPACE, READY)
    low = around[around[:, 2] <= 0.25]
    assert 0 < len(low) < len(around)
    np.testing.assert_array_equal(grasps[1], low)
    assert grasps[2:] == (ACTION.pick, SPACE, 0.02, own.config.grasp)
    assert [(name, flip) for name, flip, *_ in attempts] == [("a", 0.0), ("a", math.pi), ("b", 0.0), ("b", math.pi)]
    columns = own._columns(around, SPACE, READY)
    taken = (around[:, 1] < 0.3) & (around[:, 2] < 0.1 + 0.008)
    rest_columns = own._columns(around[~taken], SPACE, READY)
    assert (rest_columns.heights != columns.heights).any()
    for _, _, rest, rest_grid, given in attempts:
        np.testing.assert_array_equal(rest, low[low[:, 1] >= 0.3])
        np.testing.assert_array_equal(rest_grid.heights, rest_columns.heights)
        np.testing.assert_array_equal(rest_grid.seen, columns.seen, "where the object was seen, space was, too")
        np.testing.assert_array_equal(given[3].heights, columns.heights)
        assert given[1:3] == (ACTION, SPACE) and given[4] is READY
    assert phases == [(Phase.GRASP_PLANNING, 0.0), (Phase.GRASP_PLANNING, 0.5)]


def test_the_first_plan_is_taken_and_told(
    own: TransferPlanner, tries: list[tuple[Any, ...]], monkeypatch: Patch
) -> None:
    phases, checks = list[tuple[Phase, float]](), list[str]()
    budget: Any = SimpleNamespace(check=lambda reason="": checks.append(reason))
    monkeypatch.setattr(own, "budget", lambda should_stop: budget)
    own.__dict__["outcomes"] = {4: "the plan"}
    found = own.plan(ACTION, drawn_cloud(), SPACE, READY, on_phase=lambda phase, share: phases.append((phase, share)))
    assert str(found) == "the plan" and len(tries) == 4 and tries[1][4][0] is budget
    assert phases == [(Phase.GRASP_PLANNING, share) for share in (0.0, 0.5, 1.0)]
    assert checks == ["", "reason 2", "reason 2", ""], "before each attempt with why the first failed, and at the end"


def test_spent_time_ends_the_attempts_at_once(own: TransferPlanner, tries: list[tuple[Any, ...]]) -> None:
    own.__dict__["outcomes"] = {3: BudgetSpentError("too long")}
    with pytest.raises(BudgetSpentError, match="too long"):
        own.plan(ACTION, drawn_cloud(), SPACE, READY)
    assert len(tries) == 3


def test_time_that_is_spent_within_an_attempt_is_told_with_what_was_in_the_way(
    own: TransferPlanner, tries: list[tuple[Any, ...]], monkeypatch: Patch
) -> None:
    now = [7.0]
    own.clock = lambda: now[0]
    own.__dict__["outcomes"] = {3: BudgetSpentError("too long")}
    check = Budget.check

    def after_two(budget: Budget, reason: str = "") -> None:
        check(budget, reason)
        now[0] += 1e6 * (len(tries) == 2)  # while the second attempt is made

    monkeypatch.setattr(Budget, "check", after_two)
    with pytest.raises(BudgetSpentError, match=r"^planning took too long .*; reason 2$"):
        own.plan(ACTION, drawn_cloud(), SPACE, READY)
