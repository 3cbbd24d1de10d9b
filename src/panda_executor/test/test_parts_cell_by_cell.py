"""The connected parts of a cloud's cells against slow loops, and which of them a pick means."""

from __future__ import annotations

import numpy as np
import pytest
from height_grids import CELL, MIDDLE, ground, mask

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.ground_cells import BoolArray, GroundCells, points_near
from panda_executor.seen_object import _feet, _filled, _label_at, _ledge, _level_beside, _support, find_object

STEP, LEVEL = 0.007, 0.0025
Place = tuple[int, int]


def slow_bridges(cells: GroundCells, chosen: BoolArray) -> set[Place]:
    """Return the cells between two of the chosen ones in a line, one or two apart and alike in height."""
    heights = {(y, x): float(cells.top[y, x]) for y, x in np.argwhere(chosen).tolist()}
    found = set()
    for y, x in np.ndindex(chosen.shape):
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            for ahead, behind, most in ((1, 1, STEP), (1, 2, LEVEL), (2, 1, LEVEL)):
                one = heights.get((y + ahead * dy, x + ahead * dx))
                other = heights.get((y - behind * dy, x - behind * dx))
                if one is not None and other is not None and abs(one - other) < most:
                    found.add((y, x))
    return found


def slow_parts(cells: GroundCells, chosen: BoolArray) -> set[frozenset[Place]]:
    """Return the parts of `chosen`: cells that touch, also at a corner, or over a bridge that was not seen."""
    own = {(y, x) for y, x in np.argwhere(chosen).tolist()}
    left = own | {place for place in slow_bridges(cells, chosen) if not cells.seen[place]}
    parts = set()
    while left:
        edge = [left.pop()]
        part = set(edge)
        while edge:
            y, x = edge.pop()
            beside = {(y + dy, x + dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1)} & left
            left -= beside
            part |= beside
            edge += beside
        if part & own:
            parts.add(frozenset(part & own))
    return parts


def drawn(seed: int) -> tuple[GroundCells, BoolArray]:
    """Return few seen cells of few heights, and most of those as a mask."""
    rng = np.random.default_rng(seed)
    top = rng.choice([0.01, 0.0124, 0.0126, 0.0169, 0.0171], (14, 14))
    top[rng.random((14, 14)) < rng.uniform(0.3, 0.85)] = np.nan
    seen = ~np.isnan(top)
    y, x = np.meshgrid(np.arange(14) * CELL, np.arange(14) * CELL, indexing="ij")
    return GroundCells(top, top.copy(), seen, x, y, CELL), seen & (rng.random((14, 14)) < 0.8)


@pytest.mark.parametrize("seed", range(25))
def test_parts_are_those_of_the_slow_way(seed: int) -> None:
    cells, chosen = drawn(seed)
    bridges = {(y, x) for y, x in np.argwhere(cells._bridges(chosen)).tolist()}
    assert bridges == slow_bridges(cells, chosen)
    labels = cells.parts(chosen)
    np.testing.assert_array_equal(labels > 0, chosen)
    found = {
        frozenset((y, x) for y, x in np.argwhere(labels == label).tolist()) for label in np.unique(labels) if label
    }
    assert found == slow_parts(cells, chosen)


@pytest.mark.parametrize("seed", range(10))
def test_a_component_is_the_part_with_the_nearest_cell(seed: int) -> None:
    cells, chosen = drawn(seed)
    x, y = np.random.default_rng(seed).uniform(-0.01, 0.05, 2)
    away = {place: float(np.hypot(cells.x[place] - x, cells.y[place] - y)) for place in map(tuple, np.argwhere(chosen))}
    nearest = min(away, key=lambda place: away[place])
    component = cells.component(chosen, x, y, away[nearest])
    assert component is not None
    part = next(part for part in slow_parts(cells, chosen) if nearest in part)
    assert {(row, column) for row, column in np.argwhere(component).tolist()} == part
    assert cells.component(chosen, x, y, away[nearest] - 1e-6) is None
    assert cells.component(np.zeros_like(chosen), x, y, np.inf) is None


def test_a_square_is_half_as_wide_to_each_side_and_a_range_has_its_ends() -> None:
    """Lengths are binary fractions: a point on the square's edge is out, one at either end of the heights is in."""
    beside = np.array([[0.125, 0], [-0.125, 0], [0, 0.125], [0, -0.125]])
    for scale, near in ((1.0, False), (0.99, True)):
        at = np.column_stack([beside * scale + [0.5, -0.25], np.zeros(4)]).astype(np.float32)
        assert points_near(at, 0.5, -0.25, 0.125).tolist() == [near] * 4
    spec = WorkspaceSpec()
    heights = np.array([-0.125, 0.25, -0.1251, 0.2501])
    for height, seen in zip(heights, (True, True, False, False), strict=True):
        cells = GroundCells.around(np.array([[0.4, 0.1, height]], np.float32), spec, 0.4, 0.1, 8, (-0.125, 0.25))
        assert cells.seen.any() == seen
        assert (np.isnan(cells.top) == ~cells.seen).all() and (np.isnan(cells.mean) == ~cells.seen).all()


def test_rows_are_along_y_and_columns_along_x() -> None:
    points = np.array([[0.4 + 2.2 * CELL, 0.1 - 1.7 * CELL, 0.05]], np.float32)
    cells = GroundCells.around(points, WorkspaceSpec(), 0.4, 0.1, 8, (0.0, 1.0))
    assert np.argwhere(cells.seen).tolist() == [[2, 6]]
    assert cells.x[2, 6] == pytest.approx(0.4 + 2.5 * CELL) and cells.y[2, 6] == pytest.approx(0.1 - 1.5 * CELL)


@pytest.mark.parametrize(("drop", "foot"), [(0.0069, False), (0.0071, True)])
def test_a_foot_is_a_step_lower_than_a_cell_beside_it(drop: float, foot: bool) -> None:
    cells = ground((-50, 50, -50, 50, 0.05 - drop), (0, 0, 0, 0, 0.05), unseen=((1, 1, 1, 1),))
    beside = mask(-1, 1, -1, 1) & ~mask(0, 0, 0, 0) & cells.seen
    np.testing.assert_array_equal(_feet(cells), beside if foot else np.zeros_like(beside))


def test_a_rim_is_filled_although_it_has_small_gaps() -> None:
    rim = mask(-9, 9, -9, 9) & ~mask(-7, 7, -7, 7)
    for gap, filled in ((4, True), (6, False)):
        broken = rim & ~mask(5, 9, 0, gap - 1)
        assert _filled(broken)[MIDDLE, MIDDLE] == filled
        assert (_filled(broken) | ~broken).all()
    corner = np.zeros((101, 101), dtype=bool)
    corner[0, :5] = corner[:5, 0] = True
    assert not (_filled(corner) & ~mask(-50, -46, -50, -46)).any()


DISTANCE = np.hypot(*np.meshgrid(*[(np.arange(101) - MIDDLE) * CELL] * 2))
PEG = mask(-2, 2, -2, 2)


def ring(half: int, wide: int = 1) -> BoolArray:
    return mask(-half, half, -half, half) & ~mask(wide - half, half - wide, wide - half, half - wide)


def meant(*parts: BoolArray, reach: float = 0.02) -> int:
    """Return which of the parts, 1 for the first, is meant by a pick at the middle; 0: none."""
    labels = np.zeros((101, 101), dtype=np.int32)
    for number, part in enumerate(parts, 1):
        labels[part] = number
    return _label_at(labels, DISTANCE, reach, CELL)


def test_a_part_is_meant_within_reach_of_the_pick() -> None:
    block = mask(8, 15, -4, 4)
    assert meant(block, reach=8 * CELL + 1e-9) == 1 and meant(block, reach=8 * CELL - 1e-9) == 0
    assert meant(reach=0.02) == 0
    assert meant(block, mask(-15, -7, -4, 4), reach=0.03) == 2


def test_a_peg_is_smaller_than_190_square_millimetres() -> None:
    """Of 30 cells it is a peg, of 31 it is what is meant, whatever is around it."""
    thirty, more = mask(-2, 2, -3, 2), mask(-2, 2, -3, 2) | mask(3, 3, 0, 0)
    assert meant(thirty, ring(9)) == 2 and meant(more, ring(9)) == 1 and meant(thirty) == 1
    assert meant(PEG, mask(6, 14, -9, 9)) == 1  # beside, not around
    assert meant(mask(-1, 1, -1, 1), ring(3)) == 1  # a ring of 24 cells is no more than a peg itself
    assert meant(mask(-1, 1, -1, 1), ring(4)) == 2


@pytest.mark.parametrize(("reach", "found"), [(8 * CELL + 1e-6, 2), (8 * CELL - 1e-6, 1)])
def test_a_ring_is_looked_for_within_twice_the_reach(reach: float, found: int) -> None:
    assert meant(PEG, ring(16), reach=reach) == found


def test_of_two_rings_around_a_peg_the_nearer_one_is_meant() -> None:
    assert meant(PEG, ring(7), ring(12)) == 2 and meant(PEG, ring(12), ring(7)) == 3
    assert meant(PEG, mask(6, 7, -20, 20), ring(14)) == 3  # the bar is nearer, but not around it


@pytest.mark.parametrize("x", [0.0, 0.03, 0.07, -0.01])
def test_the_top_is_that_near_the_pick(x: float) -> None:
    """A ramp that rises by 1 mm a cell: its top is seen within 15 mm beyond the cell next to the pick."""
    cells = ground()
    for column in range(31):
        cells.top[MIDDLE - 4 : MIDDLE + 5, MIDDLE + column] = 0.02 + 0.001 * column
    seen = find_object(cells, PlanarPose(x, 0.0, 0.0), 0.0, 0.008, 0.005, 0.02)
    away = {
        (row, column): float(np.hypot(CELL * column - x, CELL * row)) for row in range(-4, 5) for column in range(31)
    }
    near = [0.02 + 0.001 * column for (_, column), far in away.items() if far <= min(away.values()) + 0.015]
    assert seen.top == pytest.approx(float(np.percentile(near, 95.0)), abs=1e-12)
    first = min(column for column in range(31) if 0.02 + 0.001 * column >= seen.top - 0.008)
    np.testing.assert_array_equal(seen.upper, mask(first, 30, -4, 4))


@pytest.mark.parametrize(
    ("plate", "height", "moves_along"),
    [
        ((-33, 34, -20, 20), 0.03, True),  # 167.5 mm between the outer cells' middles
        ((-34, 35, -20, 20), 0.03, False),  # 172.5 mm
        ((-20, 20, -33, 34), 0.03, True),
        ((-20, 20, -34, 35), 0.03, False),
        ((-10, 10, -10, 10), 0.0121, True),
        ((-10, 10, -10, 10), 0.0119, False),  # a base
        ((-8, 8, -4, 5), 0.03, False),  # 63 of 170 cells, 37 %
        ((-8, 9, -4, 5), 0.03, False),  # of 180, 35 %
        ((-9, 9, -4, 5), 0.03, True),  # of 190, 33 %
    ],
)
def test_what_moves_along_with_its_handle(plate: tuple[int, int, int, int], height: float, moves_along: bool) -> None:
    cells = ground((*plate, height), (-4, 4, -3, 3, 0.05))
    part = mask(-4, 4, -3, 3)
    support, whole = _support(cells, part, mask(*plate), 0.05, 0.0)
    assert support == pytest.approx(0.0 if moves_along else height)
    np.testing.assert_array_equal(whole, mask(*plate) if moves_along else part)


@pytest.mark.parametrize(("off", "flat"), [(0.0049, True), (-0.0049, True), (0.0051, False), (-0.0051, False)])
def test_a_ledge_is_what_is_level_with_it_and_touches_the_object(off: float, flat: bool) -> None:
    """Three cells may lie between the two; what is level but farther away is another thing."""
    filled = mask(-4, 4, -3, 3)
    cells = ground((7, 12, -3, 3, 0.03), (13, 15, -3, 3, 0.03 + off), (-20, -8, -3, 3, 0.03))
    ledge = mask(7, 15 if flat else 12, -3, 3)
    np.testing.assert_array_equal(_ledge(cells, filled, 0.03), ledge)


@pytest.mark.parametrize("table", [0.0, 0.01])
def test_a_level_a_step_below_the_top_carries(table: float) -> None:
    """Eight cells tell; what is no step lower belongs to the object, and the noise above the table is the table."""
    part = mask(-4, 4, -3, 3)
    for drop, level in ((0.0071, 0.05 - 0.0071), (0.0069, table)):
        assert _level_beside(ground((-10, 10, -10, 10, 0.05 - drop)), part, 0.05, table) == pytest.approx(level)
    for above, level in ((0.0024, table), (0.0026, table + 0.0026)):
        assert _level_beside(ground((-10, 10, -10, 10, table + above)), part, 0.05, table) == pytest.approx(level)
    for count, level in ((7, table), (8, 0.03)):
        cells = ground((-10, 10, -10, 10, 0.03), (-4, 4, -3, 3, 0.05))
        cells.seen[...] = False
        cells.seen[MIDDLE - 5, MIDDLE : MIDDLE + count] = True
        assert _level_beside(cells, mask(-4, 9, -3, 3), 0.05, table) == pytest.approx(level)
