"""How much of an object's place is empty and how far it went, counted cell by cell on a block that was drawn."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic_clouds import Cube, cube_points, seen_cloud

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.object_moved import moved_problem, seen_shift, vacated_share

X, Y = 0.45, 0.1


@pytest.fixture(scope="module")
def grasp(workspace: WorkspaceSpec) -> Grasp:
    return plan_grasps(seen_cloud(cube_points(Cube(X, Y, 0.3))), PlanarPose(X, Y, 0.3), workspace)[0]


def cells(grasp: Grasp) -> np.ndarray:
    """Return the middles of the object's cells (M, 2) [m, base frame]."""
    own = np.unique(np.floor(grasp.high / grasp.cell).astype(int), axis=0)
    return (own + 0.5) * grasp.cell + grasp.centroid[:2]


def cloud(at: np.ndarray, heights: np.ndarray | float) -> np.ndarray:
    return np.column_stack([at, np.broadcast_to(heights, len(at))]).astype(np.float32)


def test_a_cell_lower_than_half_of_the_object_is_vacated(grasp: Grasp) -> None:
    half = (grasp.support_z + grasp.top_z) / 2.0
    at = cells(grasp)
    for heights, share in ((half - 1e-4, 1.0), (half + 1e-4, 0.0)):
        assert vacated_share(cloud(at, heights), grasp) == share
    mixed = np.where(np.arange(len(at)) < 30, half - 1e-4, half + 1e-4)
    assert vacated_share(cloud(at, mixed), grasp) == pytest.approx(30 / len(at))
    twice = np.concatenate([cloud(at, 0.0), cloud(at[:10], half + 1e-4)])  # the highest point of a cell counts
    assert vacated_share(twice, grasp) == pytest.approx(1 - 10 / len(at))


def test_only_cells_that_are_seen_count_and_they_must_be_twenty(grasp: Grasp) -> None:
    at = cells(grasp)
    assert vacated_share(cloud(at[:19], 0.0), grasp) == 0.0
    assert vacated_share(cloud(at[:20], 0.0), grasp) == 1.0
    beside = at + np.array((0.1, 0.0))
    assert vacated_share(np.concatenate([cloud(at[:20], 0.0), cloud(beside, 0.05)]), grasp) == 1.0
    assert vacated_share(np.full((50, 3), np.nan, dtype=np.float32), grasp) == 0.0


def test_a_moved_object_is_told_with_its_shares(grasp: Grasp) -> None:
    at = cells(grasp)
    mixed = np.where(np.arange(len(at)) < len(at) // 2, 0.0, 0.04)
    share = (len(at) // 2) / len(at)
    assert moved_problem(cloud(at, mixed), grasp, share) is None
    said = moved_problem(cloud(at, mixed), grasp, share - 1e-6)
    assert said == f"the object moved: {100 * share:.0f} % of its place is empty (at most {100 * share:.0f} %)"


@pytest.mark.parametrize("shift", [(0, 0), (2, 0), (-3, 0), (0, 4), (0, -7), (5, -3), (7, 7)])
def test_a_shift_is_found_to_the_cell(grasp: Grasp, shift: tuple[int, int]) -> None:
    """The ground is seen all round where the object is not."""
    at = cells(grasp)
    steps = np.arange(-40, 41) * grasp.cell
    wide = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) + at.mean(axis=0)
    moved = at + np.multiply(shift, grasp.cell)
    seen = np.concatenate([cloud(wide, 0.0), cloud(moved, grasp.top_z)])
    np.testing.assert_allclose(seen_shift(seen, grasp), np.multiply(shift, grasp.cell), atol=1e-9)


def test_no_shift_is_found_where_less_than_half_of_the_place_is_seen(grasp: Grasp) -> None:
    at = cells(grasp)
    moved = cloud(at + np.array((4 * grasp.cell, 0.0)), grasp.top_z)
    outside = moved[moved[:, 0] > at[:, 0].max() + grasp.cell / 2]
    half = (len(at) + 1) // 2
    order = np.argsort(at[:, 0])
    for count, found in ((half, True), (half - 1, False)):
        shown = np.concatenate([cloud(at[order[:count]], 0.0), outside])
        shift = seen_shift(shown, grasp)
        assert (shift is None or bool(shift.any())) == found


def test_what_is_far_above_the_object_is_the_hand(grasp: Grasp) -> None:
    at = cells(grasp)
    hidden = cloud(at, grasp.highest_z + 0.0201)
    moved = cloud(at + np.array((12 * grasp.cell, 0.0)), grasp.top_z)
    unmoved = np.zeros(2)
    np.testing.assert_array_equal(seen_shift(np.concatenate([hidden, moved]), grasp), unmoved)
    at_most = cloud(at, grasp.highest_z + 0.0199)
    np.testing.assert_array_equal(seen_shift(at_most, grasp), unmoved)


def test_a_taller_support_raises_what_counts_as_empty(grasp: Grasp) -> None:
    raised = replace(grasp, support_z=0.03, top_z=0.05, highest_z=0.05)
    at = cells(raised)
    assert vacated_share(cloud(at, 0.0399), raised) == 1.0 and vacated_share(cloud(at, 0.0401), raised) == 0.0


def drawn(width: int, shifts: list[tuple[int, int]], unseen: int = 0) -> tuple[Grasp, np.ndarray]:
    """Return a square of so many cells, and a cloud in which it stands at each of the shifts and nowhere else.

    Of the first of them so many cells are not seen.
    """
    whole = np.array([[x + 0.5, y + 0.5] for y in range(width) for x in range(width)]) * 0.0025
    square: Any = SimpleNamespace(
        high=whole, cell=0.0025, centroid=np.array([X, Y, 0.03]), top_z=0.04, highest_z=0.04, half_height=0.02
    )
    heights = {(x, y): 0.0 for x in range(-30, 40) for y in range(-30, 40)}
    places = [[(x + dx, y + dy) for y in range(width) for x in range(width)] for dx, dy in shifts]
    heights |= {cell: 0.04 for place in places for cell in place}
    for cell in places[0][:unseen]:
        del heights[cell]
    at = (np.array(list(heights)) + 0.5) * 0.0025 + [X, Y]
    return square, cloud(at, np.array(list(heights.values())))


@pytest.mark.parametrize("turn", range(8))
@pytest.mark.parametrize(
    ("short", "far"), [((4, 4), (-6, 1)), ((0, 5), (8, -1)), ((-3, -5), (6, 0)), ((5, 3), (0, -6))]
)
def test_of_two_shifts_as_good_the_shorter_is_taken(short: tuple[int, int], far: tuple[int, int], turn: int) -> None:
    shifts = [complex(*shift) * 1j**turn for shift in (short, far)]
    flat = [(round(s.real), round(s.imag if turn < 4 else -s.imag)) for s in shifts]
    square, seen = drawn(5, flat)
    np.testing.assert_allclose(seen_shift(seen, square), np.multiply(flat[0], 0.0025), atol=1e-9)


@pytest.mark.parametrize(("unseen", "taken"), [(3, (0, -6)), (4, (0, 7))])
def test_a_shorter_shift_explains_nearly_as_many_cells(unseen: int, taken: tuple[int, int]) -> None:
    """Of 100 cells 97 are as good as all."""
    square, seen = drawn(10, [(0, -6), (0, 7)], unseen)
    np.testing.assert_allclose(seen_shift(seen, square), np.multiply(taken, 0.0025), atol=1e-9)


@pytest.mark.parametrize("turn", [1, 1j, -1, -1j])
@pytest.mark.parametrize("shift", [(8, 0), (9, 0), (8, 8), (8, -7)])
def test_an_object_is_not_followed_to_the_border_of_what_is_searched(shift: tuple[int, int], turn: complex) -> None:
    """Two centimetres are eight cells."""
    beyond = complex(*shift) * turn
    square, seen = drawn(5, [(round(beyond.real), round(beyond.imag))])
    assert seen_shift(seen, square) is None


@pytest.mark.parametrize(("cells", "went", "found"), [(80, 12, None), (80, 4, 4), (80, 0, 0), (96, 1, 0)])
def test_a_bar_that_went_along_itself(cells: int, went: int, found: int | None) -> None:
    """Of 20 cm each cell of its way explains little more; one that is longer than what is looked at stays put."""
    bar: Any = SimpleNamespace(
        high=np.array([[x + 0.5, y + 0.5] for x in range(cells) for y in range(8)]) * 0.0025,
        cell=0.0025, centroid=np.array([X, Y, 0.03]), top_z=0.04, highest_z=0.04, half_height=0.02,
    )  # fmt: skip
    ground = np.array([[x + 0.5, y + 0.5] for x in range(-40, 150) for y in range(-20, 30)]) * 0.0025 + [X, Y]
    whole = bar.high if cells < 96 else np.concatenate([bar.high + np.array([0.0025 * by, 0.0]) for by in (-30, 30)])
    shift = seen_shift(np.concatenate([cloud(ground, 0.0), cloud(whole + np.array([X + went * 0.0025, Y]), 0.04)]), bar)
    assert shift is None if found is None else shift == pytest.approx([found * 0.0025, 0.0], abs=1e-9)
