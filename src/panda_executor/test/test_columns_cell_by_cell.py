"""Columns, shadows and reach maps against slow loops over every cell, point and sphere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cliport_core.workspace import WorkspaceSpec
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.reach_map import ReachMap, pooled, with_shadows
from panda_model import FloatArray

SMALL = WorkspaceSpec(x_min=0.3, x_max=0.3925, y_min=-0.2, y_max=0.0425, z_min=-0.02, z_max=0.3, pixel_size=0.0025)
CELL = 0.01  # with the border of 0.1 m: 30 columns from x = 0.2, 45 rows from y = -0.3, the last ones in part
ROWS, COLS = 45, 30
FLOOR = 0.03


def grid_of(heights: FloatArray, x_min: float = 0.2, y_min: float = -0.3) -> ObstacleGrid:
    return ObstacleGrid(heights, x_min, y_min, CELL)


def centre_of(row: int, col: int) -> tuple[float, float]:
    return 0.2 + (col + 0.5) * CELL, -0.3 + (row + 0.5) * CELL


def test_an_empty_grid_reaches_beyond_the_workspace_and_holds_nothing() -> None:
    grid = ObstacleGrid.empty(SMALL, CELL)
    assert grid.heights.shape == (ROWS, COLS) and (grid.heights == -1.0).all()
    assert (grid.x_min, grid.y_min) == pytest.approx((0.2, -0.3))
    assert (grid.cell, grid.highest, grid.seen, grid.cameras) == (CELL, -1.0, None, ())
    assert ObstacleGrid.empty(SMALL).heights.shape == (89, 59), "cells of 5 mm"
    assert ObstacleGrid.empty(SMALL, 0.04).heights.shape == (12, 8), "the last cell may stick out"


def test_the_columns_of_a_cloud_are_those_of_a_loop_over_its_points() -> None:
    """Points on the table, off the grid, alone in their cell, and not finite."""
    rng = np.random.default_rng(2)
    drawn = rng.uniform((0.15, -0.35, -0.05), (0.55, 0.2, 0.2), (2500, 3))
    heights, count = np.full((ROWS, COLS), -1.0), np.zeros((ROWS, COLS), dtype=int)
    seen = np.zeros((ROWS, COLS), dtype=bool)
    cloud = drawn.astype(np.float32)
    cloud[::7] = np.nan
    for x, y, z in cloud[np.isfinite(cloud[:, 2])]:
        row, col = math.floor((float(y) + 0.3) / CELL), math.floor((float(x) - 0.2) / CELL)
        if 0 <= row < ROWS and 0 <= col < COLS:
            seen[row, col] = True
            if z > FLOOR:
                count[row, col] += 1
                heights[row, col] = max(heights[row, col], float(z))
    heights[count < 2] = -1.0
    camera = np.array([0.9, 0.1, 0.8])
    for given, expected in ((cloud, seen), (cloud[np.isfinite(cloud[:, 2])], seen)):
        grid = ObstacleGrid.from_cloud(given, SMALL, FLOOR, CELL, (camera,))
        np.testing.assert_array_equal(grid.heights, heights)
        np.testing.assert_array_equal(grid.seen, expected)
        np.testing.assert_array_equal(grid.cameras, [camera])
        assert (grid.x_min, grid.y_min, grid.cell) == pytest.approx((0.2, -0.3, CELL))
        assert grid.highest == heights.max()
    assert 0 < (heights > 0).sum() < seen.sum() < ROWS * COLS
    assert ObstacleGrid.from_cloud(cloud, SMALL, FLOOR).cell == 0.005


def test_the_first_and_last_cells_of_a_grid_are_filled_and_a_height_at_the_floor_is_table() -> None:
    places = [(0, 0), (0, COLS - 1), (ROWS - 1, 0), (ROWS - 1, COLS - 1)]
    points = [[*centre_of(row, col), z] for row, col in places for z in (0.1, 0.15)]
    beyond = [[*centre_of(row, col), 0.2] for row, col in ((-1, 3), (ROWS, 3), (3, -1), (3, COLS)) for _ in range(2)]
    level = [[*centre_of(20, 20), 0.5]] * 2
    cloud = np.array([*points, *beyond, *level]).astype(np.float32)
    grid = ObstacleGrid.from_cloud(cloud, SMALL, 0.5, CELL)
    assert grid.highest == -1.0, "no higher than the floor"
    grid = ObstacleGrid.from_cloud(cloud[:-2], SMALL, FLOOR, CELL)
    assert [tuple(cell) for cell in np.argwhere(grid.heights > 0)] == places
    assert grid.highest == pytest.approx(0.15)


def test_a_height_at_or_over_the_highest_column_is_over_all() -> None:
    heights = np.full((3, 4), -1.0)
    heights[1, 2] = 0.25
    grid = grid_of(heights)
    assert [grid.is_below(z) for z in (0.2499, 0.25, 0.2501)] == [False, True, True]


def test_a_point_is_in_a_column_where_it_is_lower_than_its_top() -> None:
    rng = np.random.default_rng(3)
    heights = rng.uniform(0.0, 0.2, (6, 9))
    grid = grid_of(heights)
    points = rng.uniform((0.17, -0.33, -0.1), (0.32, -0.21, 0.25), (3000, 3))
    tops = []
    for x, y, _ in points:
        row, col = math.floor((y + 0.3) / CELL), math.floor((x - 0.2) / CELL)
        tops.append(heights[row, col] if 0 <= row < 6 and 0 <= col < 9 else -1.0)
    np.testing.assert_array_equal(grid.heights_at(points[:, 0], points[:, 1]), tops)
    np.testing.assert_array_equal(grid.hits(points), points[:, 2] < np.array(tops))
    assert grid.hits(points.reshape(30, 100, 3)).shape == (30, 100)
    assert not grid.hits(np.array([0.205, -0.295, heights[0, 0]])), "on its top is free"


def test_columns_that_hold_a_point_are_taken_away_and_no_others() -> None:
    rng = np.random.default_rng(4)
    heights = rng.uniform(0.05, 0.2, (6, 9))
    seen, camera = rng.random((6, 9)) < 0.5, np.array([1.0, 0.0, 0.8])
    grid = ObstacleGrid(heights, 0.2, -0.3, CELL, seen, (camera,))
    inside, over = (2, 7), (4, 1)
    points = np.array([[*centre_of(*inside), 0.01], [*centre_of(*over), 0.21], [0.1, 0.1, 0.01]])
    left = grid.without(points)
    expected = heights.copy()
    expected[inside] = -1.0
    np.testing.assert_array_equal(left.heights, expected)
    np.testing.assert_array_equal(grid.heights, heights)
    assert left.seen is seen and left.cameras == (camera,) and (left.x_min, left.y_min, left.cell) == (0.2, -0.3, CELL)


def test_columns_that_reach_into_a_sphere_are_taken_away_and_no_others() -> None:
    rng = np.random.default_rng(5)
    heights = rng.uniform(0.05, 0.2, (ROWS, COLS))
    centres = np.array([[0.3, -0.2, 0.17], [0.42, 0.05, 0.25], [0.25, 0.02, 0.6]])
    radii = np.array([0.06, 0.09, 0.05])
    expected = heights.copy()
    for row in range(ROWS):
        for col in range(COLS):
            x, y = centre_of(row, col)
            for centre, radius in zip(centres, radii, strict=True):
                aside = math.hypot(x - centre[0], y - centre[1])
                if aside < radius and heights[row, col] > centre[2] - math.sqrt(radius**2 - aside**2):
                    expected[row, col] = -1.0
    left = grid_of(heights).without_near(centres, radii)
    np.testing.assert_array_equal(left.heights, expected)
    assert 20 < (expected < 0).sum() < 300 and (grid_of(heights).heights == heights).all()
    assert left.highest == expected.max()


@pytest.mark.parametrize("shape", [(1, 1), (4, 6), (5, 6), (4, 7), (5, 7)])
def test_pooled_cells_hold_the_highest_of_four_or_of_what_is_there(shape: tuple[int, int]) -> None:
    values = np.random.default_rng(6).normal(size=shape)
    found = pooled(values)
    assert found.shape == (math.ceil(shape[0] / 2), math.ceil(shape[1] / 2))
    for row, col in np.ndindex(*found.shape):
        assert found[row, col] == values[2 * row : 2 * row + 2, 2 * col : 2 * col + 2].max()


def raised(heights: FloatArray, cell: float, radius: float, floor: float) -> FloatArray:
    """Loop over pairs of cells: the height of a sphere's centre in one at which it may touch the other's column."""
    found = np.full(heights.shape, -1.0)
    for row, col in np.argwhere(heights > floor):
        for i, j in np.ndindex(*heights.shape):
            aside = cell * math.hypot(max(abs(i - row) - 1, 0), max(abs(j - col) - 1, 0))
            if aside <= radius:
                found[i, j] = max(found[i, j], heights[row, col] + math.sqrt(radius**2 - aside**2))
    return found


def test_a_reach_map_is_that_of_a_loop_over_pairs_of_cells() -> None:
    rng = np.random.default_rng(7)
    heights = np.where(rng.random((14, 11)) < 0.08, rng.uniform(0.0, 0.3, (14, 11)), -1.0)
    reach = ReachMap.over(heights, 0.2, -0.3, 0.013, np.array([0.05, 0.031, 0.044]), 0.1)
    np.testing.assert_allclose(reach.sizes, [0.031, 0.039, 0.047, 0.055])
    assert reach.highest == heights.max() and (reach.x_min, reach.y_min, reach.cell) == (0.2, -0.3, 0.013)
    for size, tops in zip(reach.sizes, reach.tops, strict=True):
        np.testing.assert_allclose(tops.clip(-1.0), raised(heights, 0.013, float(size), 0.1), atol=1e-12)


def test_a_map_whose_columns_do_not_pass_the_floor_is_free() -> None:
    reach = ReachMap.over(np.full((4, 5), 0.1), 0.0, 0.0, 0.01, np.array([0.03, 0.05]), 0.1)
    assert reach.highest == -10.0 and (reach.tops == -10.0).all() and reach.tops.shape == (4, 4, 5)
    assert not reach.hits(np.array([[0.02, 0.02, 0.0]]), np.array([0.05])).any()


def test_a_sphere_is_judged_by_the_smallest_size_that_holds_it() -> None:
    heights = np.full((4, 40), 0.2)
    heights[:, -1] = 0.5  # far away: a sphere wholly over all columns is free without a look at the map
    reach = ReachMap.over(heights, 0.0, 0.0, 0.01, np.array([0.03, 0.05]), 0.1)
    radii = np.array([0.03, 0.0301, 0.038, 0.0381, 0.05])
    judged_as = [0, 1, 1, 2, 3]
    np.testing.assert_array_equal(reach.classes(radii), judged_as)
    for shift, touches in ((1e-6, False), (-1e-6, True)):
        centres = np.column_stack([np.full((5, 2), 0.02), 0.2 + reach.sizes[judged_as] + shift])
        assert (reach.hits(centres, radii) == touches).all()
    assert not reach.hits(np.zeros((0, 3)), np.zeros(0)).any()


def test_spheres_beside_and_over_the_map_are_free_among_others_that_touch() -> None:
    rng = np.random.default_rng(8)
    heights = rng.uniform(0.15, 0.3, (7, 10))
    reach = ReachMap.over(heights, 0.2, -0.3, 0.02, np.array([0.03, 0.06]), 0.0)
    centres = rng.uniform((0.15, -0.35, 0.0), (0.45, -0.11, 0.5), (2000, 3))
    radii = rng.uniform(0.03, 0.06, 2000)
    expected = []
    for (x, y, z), radius in zip(centres, radii, strict=True):
        row, col = math.floor((y + 0.3) / 0.02), math.floor((x - 0.2) / 0.02)
        size = int(np.argmax(reach.sizes >= radius))
        on_map = 0 <= row < 7 and 0 <= col < 10
        expected.append(on_map and z - radius < heights.max() and z < reach.tops[size, row, col])
    np.testing.assert_array_equal(reach.hits(centres, radii), expected)
    assert 300 < sum(expected) < 1700


def shadowed(heights: FloatArray, seen: np.ndarray, cell: float, camera: FloatArray, floor: float) -> FloatArray:
    """Step along the ray from the camera over each column's top, a cell at a time, 59 times at most."""
    filled = heights.copy()
    for row, col in np.argwhere(heights > floor):
        top = heights[row, col]
        if top >= camera[2] - cell:
            continue
        x, y = 0.2 + (col + 0.5) * cell, -0.3 + (row + 0.5) * cell
        distance = max(math.hypot(x - camera[0], y - camera[1]), cell)
        for k in range(1, round(0.6 / cell)):
            line = top - k * cell * (camera[2] - top) / distance
            i = math.floor((y + k * cell * (y - camera[1]) / distance + 0.3) / cell)
            j = math.floor((x + k * cell * (x - camera[0]) / distance - 0.2) / cell)
            if line > floor and 0 <= i < heights.shape[0] and 0 <= j < heights.shape[1] and not seen[i, j]:
                filled[i, j] = max(filled[i, j], line)
    return filled


@pytest.mark.parametrize("camera", [(0.9, 0.3, 0.7), (-0.3, -0.4, 0.5), (0.31, -0.17, 0.45), (0.2, 0.6, 5.0)])
def test_shadows_are_those_of_a_loop_along_every_ray(camera: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(9)
    heights = np.where(rng.random((40, 34)) < 0.02, rng.uniform(0.0, 0.5, (40, 34)), -1.0)
    seen = rng.random((40, 34)) < 0.3
    at = np.array(camera)
    filled = with_shadows(heights, seen, 0.2, -0.3, 0.012, at, 0.05)
    np.testing.assert_allclose(filled, shadowed(heights, seen, 0.012, at, 0.05), atol=1e-12)
    assert (filled > heights).sum() > 10


@pytest.mark.parametrize("cell", [0.01, 0.005])
def test_a_shadow_ends_after_60_centimetres(cell: float) -> None:
    heights, seen = np.full((3, 160), -1.0), np.zeros((3, 160), dtype=bool)
    heights[1, 155] = 0.6
    filled = with_shadows(heights, seen, 0.0, 0.0, cell, np.array([30.0, 0.015, 0.7]), 0.05)
    count = round(0.6 / cell) - 1
    assert np.flatnonzero(filled[1, :155] > 0.0).tolist() == list(range(155 - count, 155))


@pytest.mark.parametrize("shadows", [False, True])
@pytest.mark.parametrize("pool", [1, 2])
def test_the_reach_over_a_grid_is_that_over_its_pooled_cells_with_shadows_where_asked(shadows: bool, pool: int) -> None:
    rng = np.random.default_rng(10)
    heights = np.where(rng.random((21, 33)) < 0.02, rng.uniform(0.0, 0.3, (21, 33)), -1.0)
    seen, camera, radii = rng.random((21, 33)) < 0.2, np.array([0.9, 0.2, 0.6]), np.array([0.03, 0.07])
    grid = ObstacleGrid(heights, 0.2, -0.3, CELL, seen, (camera,))
    corners = [[(i, j) for j in range(0, 33, pool)] for i in range(0, 21, pool)]
    coarse = np.array([[heights[i : i + pool, j : j + pool].max() for i, j in row] for row in corners])
    looked_at = np.array([[seen[i : i + pool, j : j + pool].any() for i, j in row] for row in corners])
    filled = shadowed(coarse, looked_at, pool * CELL, camera, 0.05) if shadows else coarse
    assert (filled > coarse).any() is np.bool_(shadows)
    reach = grid.reach(radii, 0.05, shadows, finely=pool == 1)
    for size, tops in zip(reach.sizes, reach.tops, strict=True):
        np.testing.assert_allclose(tops.clip(-1.0), raised(filled, pool * CELL, float(size), 0.05), atol=1e-12)
    assert (reach.x_min, reach.y_min, reach.cell) == (0.2, -0.3, pool * CELL)
    assert np.diff(reach.sizes) == pytest.approx({1: 0.003, 2: 0.008}[pool])
    assert grid.reach(radii, 0.05, shadows, finely=pool == 1) is reach, "it is made once"
    assert grid.reach(radii, 0.05, shadows, finely=pool != 1) is not reach


@pytest.mark.parametrize("unknown", ["seen", "camera"])
def test_without_a_camera_or_a_view_there_are_no_shadows(unknown: str) -> None:
    heights, seen = np.full((3, 60), -1.0), np.zeros((3, 60), dtype=bool)
    heights[1, 40] = 0.2
    grid = ObstacleGrid(heights, 0.0, 0.0, CELL, seen, (np.array([1.0, 0.015, 0.8]),))
    behind, radius = np.array([[0.31, 0.015, 0.08]]), np.array([0.01])
    assert grid.reach(radius, FLOOR, True).hits(behind, radius).all()
    less = replace(grid, seen=None) if unknown == "seen" else replace(grid, cameras=())
    assert not less.reach(radius, FLOOR, True).hits(behind, radius).any()
