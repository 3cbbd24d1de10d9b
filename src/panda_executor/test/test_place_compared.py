"""What counts as a change at the place: columns that rose, cells that sank, and what is too near to the hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic_clouds import Cube, cube_points, seen_cloud

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import EMPTY, ObstacleGrid
from panda_executor.place_change import LaterView, _risen, _sunk_share, pick_problem, place_problem
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import load_preset

READY = load_preset().ready
PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)
PLINTH = Cube(0.5, -0.2, 0.3, (0.08, 0.08, 0.05))
BEFORE = seen_cloud(cube_points(Cube(0.45, 0.1, 0.3)), cube_points(PLINTH))


@pytest.fixture(scope="module")
def plan(planner: TransferPlanner, workspace: WorkspaceSpec) -> PickPlacePlan:
    return planner.plan(PickPlaceAction(PICK, PLACE), BEFORE, workspace, READY)


def grid_of(plan: PickPlacePlan, heights: np.ndarray) -> ObstacleGrid:
    return replace(plan.lower.scene.grid, heights=heights, seen=np.ones(heights.shape, dtype=bool))


def test_a_column_has_risen_when_it_is_a_centimetre_higher_than_all_near_it(plan: PickPlacePlan) -> None:
    """Its neighbours up to 10 mm away, two cells, may have been a little beside before."""
    empty = np.full((40, 40), EMPTY)
    before = empty.copy()
    before[20, 20] = 0.05
    now = empty.copy()
    now[20, 20], now[20, 22], now[22, 22], now[18, 18] = 0.0599, 0.0599, 0.0601, 0.05
    now[20, 23], now[5, 5], now[6, 6] = 0.0101, 0.0099, 0.0101
    risen = _risen(grid_of(plan, before), grid_of(plan, now))
    expected = empty.copy()
    expected[22, 22], expected[20, 23], expected[6, 6] = 0.0601, 0.0101, 0.0101
    np.testing.assert_array_equal(risen.heights, expected)
    assert risen.seen is None and risen.cameras == ()


@pytest.mark.parametrize(
    ("columns", "problem"),
    [([(0, 0)], False), ([(0, column) for column in range(8)], False), ([(0, 0), (0, 1), (1, 0), (1, 1)], True)],
    ids=["one", "a row", "a square"],
)
def test_pixels_that_fly_at_the_hands_edge_are_nothing_that_came(
    plan: PickPlacePlan,
    planner: TransferPlanner,
    workspace: WorkspaceSpec,
    columns: list[tuple[int, int]],
    problem: bool,
) -> None:
    grid = plan.lower.scene.grid
    row, column = int((PLACE.y - grid.y_min) / grid.cell), int((PLACE.x - grid.x_min) / grid.cell)
    x = grid.x_min + grid.cell * np.array([column + dx + 0.5 for _, dx in columns])
    y = grid.y_min + grid.cell * np.array([row + dy + 0.5 for dy, _ in columns])
    flying = np.stack([x, y, np.full(len(columns), 0.1)], axis=1).astype(np.float32)
    came = seen_cloud(cube_points(PLINTH), np.repeat(flying, 2, axis=0))
    found = place_problem(plan, LaterView(came, workspace, plan.lower.trajectory.positions[0]), planner.motions)
    assert (found is not None) == problem


def under(plan: PickPlacePlan, planner: TransferPlanner) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the cells under what is let go."""
    held, grid = plan.lower.scene.hand.held, plan.lower.scene.grid
    assert held is not None
    rotation, translation = planner.model.tcp_arrays(plan.lower.trajectory.positions[-1])
    at = held.cells @ rotation[:2, :2].T + translation[:2]
    np.testing.assert_allclose(at.mean(axis=0), [PLACE.x, PLACE.y], atol=0.004)
    cells = np.floor((at - [grid.x_min, grid.y_min]) / grid.cell).astype(int)
    column, row = np.unique(cells, axis=0).T
    return row, column


@pytest.mark.parametrize(("sunk", "counts"), [(0.0149, False), (0.0151, True)])
def test_a_cell_is_sunk_when_it_is_so_much_lower_than_what_carried(
    plan: PickPlacePlan, planner: TransferPlanner, sunk: float, counts: bool
) -> None:
    row, column = under(plan, planner)
    before = plan.lower.scene.grid.heights
    carrying = before[row, column] > plan.placement.support_z - 0.01
    assert carrying.sum() >= 8
    now = before.copy()
    now[row, column] -= sunk
    share = _sunk_share(plan, grid_of(plan, now), planner.motions)
    assert share == (1.0 if counts else 0.0)


def test_the_share_is_that_of_the_carrying_cells_that_are_seen(plan: PickPlacePlan, planner: TransferPlanner) -> None:
    row, column = under(plan, planner)
    before = plan.lower.scene.grid.heights
    carrying = np.flatnonzero(before[row, column] > plan.placement.support_z - 0.01)
    now = before.copy()
    gone = carrying[::3]
    now[row[gone], column[gone]] = EMPTY  # the table is seen there
    grid = grid_of(plan, now)
    assert _sunk_share(plan, grid, planner.motions) == pytest.approx(len(gone) / len(carrying))
    assert grid.seen is not None
    grid.seen[row[gone[1:]], column[gone[1:]]] = False
    assert _sunk_share(plan, grid, planner.motions) == pytest.approx(1 / (len(carrying) - len(gone) + 1))
    grid.seen[...] = False
    grid.seen[row[carrying[:7]], column[carrying[:7]]] = True
    assert _sunk_share(plan, grid, planner.motions) == 0.0  # seven cells prove nothing
    grid.seen[row[carrying[7]], column[carrying[7]]] = True
    assert _sunk_share(plan, grid, planner.motions) > 0.0
    assert _sunk_share(plan, replace(grid, seen=None), planner.motions) == 0.0


def test_only_what_is_lower_than_the_hand_and_its_load_is_compared(
    plan: PickPlacePlan, planner: TransferPlanner, workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[np.ndarray] = []
    from_cloud = ObstacleGrid.from_cloud

    def note(cloud: np.ndarray, *others: Any) -> ObstacleGrid:
        shown.append(cloud)
        return from_cloud(cloud, *others)

    above = plan.lower.trajectory.positions[0]
    rotation, translation = planner.model.tcp_arrays(above)
    lowest = float((plan.lower.scene.hand.points @ rotation.T + translation)[:, 2].min())
    heights = np.array([lowest - 0.0201, lowest - 0.0199, lowest, 0.02])
    cloud = np.column_stack([np.full((4, 2), (PLACE.x, PLACE.y)), heights]).astype(np.float32)
    cloud = np.concatenate([cloud, np.full((1, 3), np.nan, dtype=np.float32)])
    monkeypatch.setattr("panda_executor.place_change.ObstacleGrid.from_cloud", note)
    place_problem(plan, LaterView(cloud, workspace, above), planner.motions)
    np.testing.assert_array_equal(shown[0], cloud[[0, 3]])


@pytest.mark.parametrize(("lower", "seen"), [(0.0, False), (0.06, True)])
def test_the_hand_on_its_way_is_nothing_that_came(
    planner: TransferPlanner, workspace: WorkspaceSpec, lower: float, seen: bool
) -> None:
    """A cloud may be of the middle of a way, where the hand is 4 cm lower; what lies lower still is a thing."""
    cube = Cube(0.32, -0.4, 0.0)
    action = PickPlaceAction(PlanarPose(cube.x, cube.y, 0.0), PlanarPose(0.32, 0.4, 0.0))
    plan = planner.plan(action, seen_cloud(cube_points(cube)), workspace, READY)
    way, hand = plan.carry.trajectory, plan.lower.scene.hand.points
    rotation, at = planner.model.tcp_arrays(way.sample(np.array([0.5 * way.duration]))[0][0])
    bottom = float((hand @ rotation[2]).min() + at[2]) - lower
    carried = cube_points(Cube(at[0], at[1], z=bottom))
    found = LaterView(seen_cloud(carried), workspace, way.end).below(plan.carry, plan.lower, planner.motions)
    assert (found.highest > 0.0) == seen


def test_what_the_hand_passed_is_that_of_the_way_that_led_there(
    plan: PickPlacePlan, planner: TransferPlanner, workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways: list[Motion] = []

    def note(grid: ObstacleGrid, way: Motion, *_: Any) -> np.ndarray:
        ways.append(way)
        return np.full(grid.heights.shape, np.inf)

    monkeypatch.setattr("panda_executor.place_change._underside", note)
    place_problem(plan, LaterView(BEFORE, workspace, plan.lower.trajectory.start), planner.motions)
    pick_problem(plan, LaterView(BEFORE, workspace, plan.descend.trajectory.start), planner.motions)
    assert ways == [plan.carry, plan.go_above]


@pytest.mark.parametrize(("x", "problem"), [(0.5, True), (0.3, False)])
def test_what_came_is_a_problem_where_the_hand_goes(
    plan: PickPlacePlan, planner: TransferPlanner, workspace: WorkspaceSpec, x: float, problem: bool
) -> None:
    above = plan.lower.trajectory.positions[0]
    came = seen_cloud(cube_points(PLINTH), cube_points(Cube(x, -0.2, 0.0, (0.04, 0.04, 0.09))))
    found = place_problem(plan, LaterView(came, workspace, above), planner.motions)
    assert (found is not None) == problem
    assert found is None or found.startswith("something came there: ")


def test_a_support_that_is_gone_is_told_with_its_share(
    plan: PickPlacePlan, planner: TransferPlanner, workspace: WorkspaceSpec
) -> None:
    above = plan.lower.trajectory.positions[0]
    said = place_problem(plan, LaterView(seen_cloud(), workspace, above), planner.motions)
    assert said == "100 % of what was to carry the object is gone"
    assert place_problem(plan, LaterView(seen_cloud(cube_points(PLINTH)), workspace, above), planner.motions) is None
