"""What an object stands on and what moves along with it, on cells that were drawn by hand and against a slow way."""

from __future__ import annotations

import numpy as np
import pytest
from height_grids import CELL, MIDDLE, ground, mask

from cliport_core.pose import PlanarPose
from panda_executor.errors import GraspError
from panda_executor.ground_cells import GroundCells
from panda_executor.seen_object import SeenObject, _level_beside, _lowest_around, _ring, find_object

PART = mask(-4, 4, -3, 3)
HEIGHT = 0.05
BLOCK = (-4, 4, -3, 3, HEIGHT)


def find(cells: GroundCells, x: float = 0.0, y: float = 0.0, table: float = 0.0, reach: float = 0.02) -> SeenObject:
    return find_object(cells, PlanarPose(x, y, 0.0), table, 0.03, 0.005, reach)


def slow_level(heights: np.ndarray, top: float, table: float) -> float | None:
    """Return the highest level that holds three tenths of all heights that are a step lower than `top`."""
    heights = np.array(sorted((h for h in heights if h < top - 0.007), reverse=True))
    if len(heights) < 8:
        return table
    for highest in heights:
        same = [h for h in heights if highest - 0.005 <= h <= highest]
        if len(same) >= 0.3 * len(heights):
            level = float(np.median(same))
            return level if level > table + 0.0025 else table
    return None


@pytest.mark.parametrize("seed", range(60))
def test_the_level_beside_an_object_is_that_of_the_slow_way(seed: int) -> None:
    """Some heights lie on one surface, the others anywhere; sometimes there is no surface, or few are seen."""
    rng = np.random.default_rng(seed)
    cells = ground(BLOCK)
    beside = _ring(PART, 0, 2)
    count = int(beside.sum())
    drawn = rng.uniform(0.0, 0.06, count)
    surface = rng.random(count) < rng.uniform(0.0, 0.8)
    drawn[surface] = rng.choice([0.001, 0.012, 0.03]) + rng.uniform(-0.0024, 0.0024, int(surface.sum()))
    drawn[rng.random(count) < rng.choice([0.0, 0.5, 0.9])] = np.nan
    cells.top[beside] = drawn
    cells.seen[...] = ~np.isnan(cells.top)
    table = float(rng.choice([0.0, 0.01]))
    expected = slow_level(drawn[~np.isnan(drawn)], HEIGHT, table)
    found = _level_beside(cells, PART, HEIGHT, table)
    assert (found is None) == (expected is None)
    assert found is None or found == pytest.approx(expected, abs=1e-12)


def test_the_lowest_around_is_the_fifth_of_what_is_seen_farther_out() -> None:
    cells = ground(BLOCK)
    wide = _ring(PART, 2, 5)
    rows, columns = np.nonzero(wide)
    count = len(rows)
    cells.top[rows, columns] = np.linspace(0.02, 0.04, count)
    cells.top[_ring(PART, 0, 2)] = 0.01  # right beside it
    assert _lowest_around(cells, PART, 0.0) == pytest.approx(0.024, abs=1e-9)
    assert _lowest_around(cells, PART, 0.0191) == 0.0191  # no more than the noise above the table
    assert _lowest_around(cells, PART, 0.0189) == pytest.approx(0.024, abs=1e-9)
    cells.seen[rows[9:], columns[9:]] = False
    assert _lowest_around(cells, PART, 0.003) == 0.003  # nine cells say nothing
    cells.seen[rows[9], columns[9]] = True
    assert _lowest_around(cells, PART, 0.003) > 0.02


def test_a_ring_is_so_many_cells_wide() -> None:
    one = mask(0, 0, 0, 0)
    at = np.arange(2 * MIDDLE + 1) - MIDDLE
    away = np.maximum(np.abs(at[:, None]), np.abs(at))
    for inner, outer in ((0, 2), (2, 5), (0, 3)):
        np.testing.assert_array_equal(_ring(one, inner, outer), (away > inner) & (away <= outer))


def test_a_block_on_the_table_stands_on_it() -> None:
    seen = find(ground(BLOCK))
    np.testing.assert_array_equal(seen.whole, PART)
    np.testing.assert_array_equal(seen.upper, PART)
    assert seen.top == pytest.approx(HEIGHT) and seen.support_z == 0.0


@pytest.mark.parametrize(
    ("plate", "height", "support", "moves_along"),
    [
        ((-30, 30, -20, 20), 0.012, 0.012, False),  # a base
        ((-30, 30, -20, 20), 0.03, 0.0, True),  # covers little of what moves along: a handle
        ((-36, 36, -20, 20), 0.03, 0.03, False),  # too large to move
        ((-6, 6, -5, 5), 0.03, 0.03, False),  # stacked: covers half of it
        ((-8, 8, -6, 6), 0.03, 0.0, True),
    ],
)
def test_what_an_object_stands_on_and_what_moves_along(
    plate: tuple[int, int, int, int], height: float, support: float, moves_along: bool
) -> None:
    seen = find(ground((*plate, height), BLOCK))
    assert seen.support_z == pytest.approx(support)
    np.testing.assert_array_equal(seen.whole, mask(*plate) if moves_along else PART)
    np.testing.assert_array_equal(seen.upper, PART)


def test_without_a_surface_everything_connected_is_one() -> None:
    """A slope beside the top is no level: the thing and the table below it are what is left."""
    cells = ground(BLOCK)
    rows = np.arange(-3, 4)
    for step in range(1, 9):
        cells.top[np.ix_(MIDDLE + rows, [MIDDLE - 4 - step, MIDDLE + 4 + step])] = HEIGHT - 0.0055 * step
        for row in (-3 - step, 3 + step):
            cells.top[MIDDLE + row, MIDDLE - 4 - step : MIDDLE + 5 + step] = HEIGHT - 0.0055 * step
            cells.top[MIDDLE - 3 - step : MIDDLE + 4 + step, [MIDDLE - 4 - step, MIDDLE + 4 + step]] = (
                HEIGHT - 0.0055 * step
            )
    seen = find(cells)
    assert seen.whole.sum() > 2 * PART.sum() and seen.whole[PART].all()
    assert seen.support_z == 0.0


def test_only_what_is_within_a_fingers_reach_of_the_top_is_upper() -> None:
    """A flight of low steps belongs to the part; of it only what is less than 30 mm below the top is held."""
    stairs = [(4 + 3 * i, 6 + 3 * i, -3, 3, 0.06 - 0.006 * i) for i in range(10)]
    seen = find(ground((-4, 3, -3, 3, 0.06), *stairs))
    assert seen.top == pytest.approx(0.06)
    lowest = np.unique(seen.upper.nonzero()[1])[-1] - MIDDLE
    assert lowest == 6 + 3 * 5  # the fifth step is 30 mm below, the sixth is more
    assert seen.upper[:, : MIDDLE - 4].sum() == 0


@pytest.mark.parametrize(("away", "found"), [(0.0199, True), (0.0201, False)])
def test_an_object_is_no_farther_from_the_pick_than_reach(away: float, found: bool) -> None:
    cells = ground(BLOCK)
    for x, y in ((4 * CELL + away, 0.0), (-4 * CELL - away, 0.0), (0.0, 3 * CELL + away), (0.0, -3 * CELL - away)):
        if found:
            assert find(cells, x, y).top == pytest.approx(HEIGHT)
        else:
            with pytest.raises(GraspError, match=rf"more than 5 mm above the table at the pick \({x:.3f}, {y:.3f}\)"):
                find(cells, x, y)


@pytest.mark.parametrize(
    ("height", "table", "found"), [(0.0051, 0.0, True), (0.0049, 0.0, False), (0.0049, -0.001, True)]
)
def test_what_hardly_rises_above_the_table_is_flat(height: float, table: float, found: bool) -> None:
    cells = ground((-4, 4, -3, 3, height))
    if found:
        assert find(cells, table=table).top == pytest.approx(height)
    else:
        with pytest.raises(GraspError, match="nothing rises"):
            find(cells, table=table)


def test_three_cells_are_no_object_and_four_are() -> None:
    with pytest.raises(GraspError, match="nothing rises"):
        find(ground((0, 2, 0, 0, 0.05)))
    assert find(ground((0, 3, 0, 0, 0.05))).top == pytest.approx(0.05)


@pytest.mark.parametrize(("half", "ring"), [(2, True), (3, False)])
def test_a_peg_in_a_hole_means_the_ring_around_it(half: int, ring: bool) -> None:
    """Of 5 x 5 cells (156 mm2) it is a peg, of 7 x 7 (306 mm2) it is what is meant."""
    outer, inner = 11, 7
    seen = find(
        ground(
            (-outer, outer, -outer, outer, 0.03), (-inner, inner, -inner, inner, 0.0), (-half, half, -half, half, 0.05)
        )
    )
    around = mask(-outer, outer, -outer, outer) & ~mask(-inner, inner, -inner, inner)
    np.testing.assert_array_equal(seen.upper, around if ring else mask(-half, half, -half, half))
    assert seen.top == pytest.approx(0.03 if ring else 0.05)
