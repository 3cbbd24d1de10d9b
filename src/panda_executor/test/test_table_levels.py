"""Which of the levels that a cloud shows is the table, and the exact plane through its points."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cliport_core.workspace import WorkspaceSpec
from panda_executor.table_plane import TableConfig, TablePlane, _lowest_level, measure_table

SPACE = WorkspaceSpec(x_min=0.25, x_max=0.5, y_min=-0.5, y_max=0.25)
CONFIG = TableConfig()
TABLE = 0.1  # configured [m]


def points(z: float, count: int = 2000, seed: int = 0) -> np.ndarray:
    """Return points of a level at `z` [m], all over the workspace."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform((0.26, -0.49), (0.49, 0.24), (count, 2)), np.full(count, z)])


def measured(*levels: np.ndarray, config: TableConfig | None = None) -> TablePlane | None:
    return measure_table(np.concatenate(levels).astype(np.float32), SPACE, TABLE, config)


def height(*levels: np.ndarray, config: TableConfig | None = None) -> float:
    plane = measured(*levels, config=config)
    assert plane is not None
    return plane.height


def test_a_height_elsewhere_follows_the_slopes() -> None:
    plane = TablePlane(0.01, 0.1, -0.2, 0.4, 0.1)
    assert plane.height_at(0.4, 0.1) == 0.01
    assert plane.height_at(0.5, 0.4) == pytest.approx(0.01 + 0.1 * 0.1 - 0.2 * 0.3)


@pytest.mark.parametrize(("along_x", "along_y"), itertools.product((-0.02, 0.02), repeat=2))
@pytest.mark.parametrize("rise", [-0.01, 0.01])
def test_the_worst_difference_is_that_of_the_corner_that_is_furthest_off(
    along_x: float, along_y: float, rise: float
) -> None:
    plane = TablePlane(TABLE + rise, along_x, along_y, 0.3, 0.0)
    offs = [rise + along_x * (x - 0.3) + along_y * y for x in (0.25, 0.5) for y in (-0.5, 0.25)]
    low, high = min(offs), max(offs)
    assert plane.worst(SPACE, TABLE) == pytest.approx(low if -low > high else high)


@pytest.mark.parametrize(("along_y", "over", "count"), [(-0.01, 0.012, 700), (-0.02, 0.008, 1900)])
def test_a_tilted_plane_is_found_exactly_though_other_things_stand_on_it(
    along_y: float, over: float, count: int
) -> None:
    """Where the tilt is large, things at its low side are as high as the table's middle: the first fit takes some."""
    tilted, thing = points(0.0), points(over, count, 1)
    for level in (tilted, thing):
        level[:, 2] += 0.108 + 0.02 * (level[:, 0] - 0.375) + along_y * (level[:, 1] + 0.125)
    plane = measured(tilted, thing)
    assert plane is not None and (plane.x, plane.y) == (0.375, -0.125)
    assert (plane.height, plane.slope_x, plane.slope_y) == pytest.approx((0.108, 0.02, along_y), abs=1e-6)


@pytest.mark.parametrize(
    ("axis", "bound", "outwards"), [(0, 0.25, -1.0), (0, 0.5, 1.0), (1, -0.5, -1.0), (1, 0.25, 1.0)]
)
def test_what_is_on_a_bound_of_the_workspace_or_beyond_is_not_looked_at(
    axis: int, bound: float, outwards: float
) -> None:
    on_it, beyond = points(TABLE - 0.02, 9000), points(TABLE - 0.02, 9000)
    assert height(points(TABLE), on_it) < TABLE - 0.015, "it is, within"
    on_it[:, axis] = bound
    beyond[:, axis] += outwards
    for other in (on_it, beyond):
        assert height(points(TABLE), other) == pytest.approx(TABLE, abs=1e-6)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_table_is_looked_for_three_centimetres_up_and_down(side: float) -> None:
    assert height(points(TABLE + side * 0.029)) == pytest.approx(TABLE + side * 0.029, abs=1e-6)
    assert measured(points(TABLE + side * 0.031)) is None


def test_three_hundred_points_are_a_table_and_fewer_are_not() -> None:
    assert measured(points(TABLE, 299)) is None
    assert height(points(TABLE, 300)) == pytest.approx(TABLE, abs=1e-6)
    spread = points(TABLE + 0.02, 200)
    assert measured(points(TABLE, 299), spread) is None, "of its own, those of other levels do not count"
    assert height(points(TABLE, 300), spread) == pytest.approx(TABLE, abs=1e-6)


@pytest.mark.parametrize(("over", "counts"), [(0.0049, True), (0.0051, False)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_points_within_half_a_centimetre_are_the_tables_own(side: float, over: float, counts: bool) -> None:
    """A few of them lift the plane by their share; those further off do not."""
    base = np.tile(points(TABLE + 0.00125, 500), (4, 1))
    off = base[:20] + np.array([0.0, 0.0, side * over])
    share = side * over * 20 / 2020 if counts else 0.0
    assert height(base, off) == pytest.approx(TABLE + 0.00125 + share, abs=2.5e-5)
    assert abs(height(base, off) - TABLE - 0.00125) > 2e-5 or not counts


@pytest.mark.parametrize(("count", "is_table"), [(599, False), (600, True)])
def test_a_lower_level_is_the_table_from_its_share_of_points_on(count: int, is_table: bool) -> None:
    found = height(points(TABLE - 0.0188, count), points(TABLE + 0.0012, 2000))
    assert found == pytest.approx(TABLE - 0.0188 if is_table else TABLE + 0.0012, abs=1e-6)
    half = replace(CONFIG, level_share=0.2)
    assert height(points(TABLE - 0.0188, 401), points(TABLE + 0.0012), config=half) < TABLE


@pytest.mark.parametrize(
    ("counts", "level"),
    [
        ({0: 50, 10: 100}, 0),
        ({3: 29, 10: 100}, 10),
        ({3: 30, 10: 100}, 3),
        ({5: 40, 6: 70, 7: 90, 8: 80, 12: 100}, 7),
        ({5: 40, 6: 40, 7: 90}, 5),
        ({22: 40, 23: 100}, 23),
        ({23: 100}, 23),
    ],
)
def test_the_lowest_full_level_is_climbed_to_its_top(counts: dict[int, int], level: int) -> None:
    """Levels are 2.5 mm high, the first begins 3 cm below the configured height."""
    heights = [np.full(count, TABLE - 0.03 + 0.0025 * number + 0.001) for number, count in counts.items()]
    found = _lowest_level(np.concatenate(heights), TABLE, CONFIG)
    assert found == pytest.approx(TABLE - 0.03 + 0.0025 * (level + 0.5))
