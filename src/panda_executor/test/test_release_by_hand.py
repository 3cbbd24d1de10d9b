"""What a grasp holds and covers, and how low the hand may let go, against slow ways and on cells drawn by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from height_grids import CELL, MIDDLE, ground
from scipy import ndimage

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import placement as module
from panda_executor.grasp import Grasp
from panda_executor.ground_cells import GroundCells
from panda_executor.placement import PlacementConfig, _above_surroundings, _highest, _under, plan_placement
from panda_model import load_preset

HAND = load_preset().hand
CONFIG = PlacementConfig()


def block(left: int, right: int, low: int, high: int) -> np.ndarray:
    """Return the middles (N, 2) [m] of cells, first and last column and row, of which 0 begins at 0."""
    return np.array([[x + 0.5, y + 0.5] for y in range(low, high + 1) for x in range(left, right + 1)]) * CELL


GRASP = Grasp(
    centroid=np.array([0.45, 0.1, 0.03]),
    tcp_z=0.04,
    yaw=0.3,
    opening=0.07,
    width=0.03,
    length=0.05,
    support_z=0.01,
    top_z=0.055,
    highest_z=0.055,
    footprint=block(-5, 4, -4, 3),
    inner=np.array([[0.01, 0.0], [0.0, 0.02], [-0.003, 0.004]]),
    cell=CELL,
    spare=0.006,
    hand=HAND,
    high=np.zeros((0, 2)),
)


@pytest.mark.parametrize(("yaw", "flip"), [(0.0, 0.0), (0.7, 0.0), (-0.4, 1.1), (0.7, math.pi)])
def test_what_is_held_lies_in_the_frame_of_the_fingers(yaw: float, flip: float) -> None:
    """The closing direction is y there, and x is to its left: the hand looks down."""
    held = replace(GRASP, yaw=yaw).held(flip)
    closing = complex(math.cos(yaw + flip), math.sin(yaw + flip))
    for cell, (x, y) in zip(GRASP.inner, held.cells, strict=True):
        np.testing.assert_allclose(complex(*cell), y * closing + x * closing * 1j, atol=1e-12)


def test_what_is_held_reaches_from_just_above_its_support_to_its_top() -> None:
    held = GRASP.held()
    assert held.below == pytest.approx(0.04 - 0.01 - 0.005) and held.above == pytest.approx(0.015)
    low = replace(GRASP, support_z=0.03, highest_z=0.035).held()
    assert low.below == HAND.fingertip_below_tcp and low.above == 0.0


def test_a_grasp_is_raised_by_what_it_has_to_spare() -> None:
    some, all_of_it = GRASP.raised(0.002), GRASP.raised(0.01)
    assert (some.tcp_z, some.spare) == pytest.approx((0.042, 0.004))
    assert (all_of_it.tcp_z, all_of_it.spare) == pytest.approx((0.046, 0.0))
    assert replace(some, tcp_z=GRASP.tcp_z, spare=GRASP.spare).held().above == GRASP.held().above
    assert some.footprint is GRASP.footprint and some.hand is HAND


def points(at: np.ndarray, z: np.ndarray | float = 0.03) -> np.ndarray:
    """Return points (N, 3) at places relative to the grasp's centroid."""
    return np.column_stack([at + GRASP.centroid[:2], np.broadcast_to(z, len(at))]).astype(np.float32)


def test_one_cell_covers_a_square_as_wide_as_the_margin_and_a_cell() -> None:
    one = replace(GRASP, footprint=np.zeros((1, 2)))
    near, far = 0.0104, 0.0106  # of a margin of 8 mm and a cell of 2.5
    signs = np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, 1], [1, -1], [-1, -1]])
    assert one.covers(points(near * signs), 0.008).all()
    assert not one.covers(points(far * signs), 0.008).any()
    heights = np.array([0.0119, 0.0121, 0.5, -1.0, np.nan])
    assert one.covers(points(np.zeros((5, 2)), heights), 0.008).tolist() == [False, True, True, False, False]
    assert one.covers(points(np.array([[np.nan, 0.0], [0.0, np.nan]])), 0.008).tolist() == [False, False]


@pytest.mark.parametrize("margin", [0.004, 0.008])
def test_a_grasp_covers_what_is_near_one_of_its_cells(margin: float) -> None:
    """The corner of an L, whose sides are 10 and 6 cells long, stays free."""
    cells = np.array([[k, 0.0] for k in range(11)] + [[0.0, -k] for k in range(1, 7)])
    some = replace(GRASP, footprint=cells * CELL)
    rng = np.random.default_rng(3)
    steps = math.ceil(margin / CELL)
    # Points keep off the edges of cells, which begin where the farthest cell's do.
    shift = (margin / CELL) % 1.0
    index = rng.integers(-20, 20, (3000, 2))
    at = index - shift + rng.uniform(0.1, 0.9, (3000, 2))
    reach = 10.0 + margin / CELL + 1.0
    away = np.abs(index[:, None] - cells).max(axis=-1).min(axis=1)
    expected = (away <= steps) & (np.abs(at) < reach).all(axis=1)
    found = some.covers(points(at * CELL), margin)
    assert 100 < expected.sum() < 2500
    np.testing.assert_array_equal(found, expected)


def slow_surroundings(cells: GroundCells, place: PlanarPose, yaw: float, width: float, opening: float) -> float:
    """Return the lowest tcp above the third highest cell under each of pads, mounts and palm, 4 mm kept all round."""
    parts = (
        (width / 2, opening / 2 + 0.0152, 0.0105, -0.0095),
        (width / 2, opening / 2 + 0.026, 0.0105, 0.0235),
        (0.0, 0.103, 0.032, 0.0375),
    )
    needed = [-math.inf]
    for inner, outer, half_width, underside in parts:
        heights = []
        for row, column in np.argwhere(cells.seen):
            at = complex(cells.x[row, column] - place.x, cells.y[row, column] - place.y)
            turned = at * complex(math.cos(yaw), -math.sin(yaw))
            along, across = abs(turned.real), abs(turned.imag)
            if inner - 0.004 < along < outer + 0.004 and across < half_width + 0.004:
                heights.append(float(cells.top[row, column]))
        if len(heights) >= 3:
            needed.append(sorted(heights)[-3] - underside + 0.004)
    return max(needed)


@pytest.mark.parametrize("seed", range(16))
def test_the_hand_is_above_its_surroundings_as_the_slow_way_says(seed: int) -> None:
    """Lone cells and pairs are noise; of drawn groups of three, few are seen, at a drawn yaw and place."""
    rng = np.random.default_rng(seed)
    cells = ground()
    cells.seen[...] = False
    for _ in range(int(rng.integers(1, 30))):
        row, column, count = int(rng.integers(0, 99)), int(rng.integers(0, 101)), int(rng.integers(1, 5))
        cells.seen[row : row + count, column] = True
        cells.top[row : row + count, column] = rng.uniform(0.0, 0.2) * rng.choice([0.2, 1.0])
    yaw = float(rng.uniform(-3, 3))
    place = PlanarPose(float(rng.uniform(-0.02, 0.02)), float(rng.uniform(-0.02, 0.02)), 5.0)
    opening = float(rng.uniform(0.04, 0.08))
    some = replace(GRASP, width=float(rng.uniform(0.005, 0.04)))
    expected = slow_surroundings(cells, place, yaw, some.width, opening)
    assert _above_surroundings(cells, place, yaw, some, opening, CONFIG) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2])
@pytest.mark.parametrize("sign", [-1, 1])
def test_each_part_of_the_hand_begins_and_ends_where_it_does(yaw: float, sign: int) -> None:
    """Of a hand that opens from 30 to 50 mm: pads from 11 to 44.2 mm, mounts to 55, the palm to 107, all with 4 mm."""
    tall = 0.1

    def needed(along: int, across: int = 0) -> float:
        rows, columns = (
            ([across - 1, across + 1], [along, along]) if not yaw else ([along, along], [across - 1, across + 1])
        )
        cells = ground(unseen=((-50, 50, -50, 50),))
        at = np.ix_(range(MIDDLE + rows[0], MIDDLE + rows[1] + 1), range(MIDDLE + columns[0], MIDDLE + columns[1] + 1))
        cells.seen[at], cells.top[at] = True, tall
        return _above_surroundings(cells, PlanarPose(0.0, 0.0, 0.0), yaw, GRASP, 0.05, CONFIG) - tall - 0.004

    palm, mount, pad = -HAND.palm_above_tcp, -HAND.mount_above_tcp, HAND.fingertip_below_tcp
    found = [needed(sign * along) for along in (0, 4, 5, 17, 18, 21, 23, 42, 43)]
    assert found == pytest.approx([palm, palm, pad, pad, mount, mount, palm, palm, -math.inf])
    across = [needed(sign * 10, across) for across in (4, 7, 13, -4, -7, -13)]
    assert across == pytest.approx([pad, palm, palm] * 2)
    assert needed(sign * 10, 16) == -math.inf


def test_lone_noise_is_not_the_highest() -> None:
    assert _highest(np.array([0.3, 0.1, 0.5, 0.2])) == 0.2
    assert _highest(np.array([0.3, 0.1, 0.5])) == 0.1 and _highest(np.array([0.3, 0.5])) == -math.inf


@pytest.mark.parametrize("turn", [0.0, 0.4, math.pi / 2, -2.0])
def test_the_cells_under_an_object_turn_with_it_and_have_no_gaps(turn: float) -> None:
    footprint = block(-3, 16, -8, 1)
    cells = ground()
    cells.seen[:, MIDDLE] = False
    under = _under(cells, PlanarPose(0.0, 0.0, 0.0), replace(GRASP, footprint=footprint), turn)
    assert not under[:, MIDDLE].any()
    cells.seen[:, MIDDLE] = True
    under = _under(cells, PlanarPose(0.0, 0.0, 0.0), replace(GRASP, footprint=footprint), turn)
    turned = [complex(*cell) * complex(math.cos(turn), math.sin(turn)) / CELL for cell in footprint]
    if turn:
        own = {(math.floor(at.real + 50.5), math.floor(at.imag + 50.5)) for at in turned}
        assert all(under[row, column] for column, row in own)
    assert 195 <= under.sum() <= 210
    np.testing.assert_array_equal(ndimage.binary_fill_holes(under), under)
    at = np.argwhere(under)[:, ::-1] - MIDDLE
    nearest = np.abs(at[:, None] - np.array([[a.real, a.imag] for a in turned])).max(axis=-1).min(axis=1)
    assert nearest.max() < 1.6


def test_a_footprint_is_cut_off_at_the_last_cells() -> None:
    wide = replace(GRASP, footprint=block(-60, 60, 0, 2))
    under = _under(ground(), PlanarPose(0.0, 0.0, 0.0), wide, 0.0)
    assert under[:, 1:-1].any(axis=0).all() and set(np.nonzero(under)[0].tolist()) <= set(range(MIDDLE, MIDDLE + 4))


PLACE = PlanarPose(0.5, -0.2, 0.3)


def table(heights: np.ndarray | float = 0.0) -> np.ndarray:
    """Return a point on the middle of each of 96 x 96 cells about the place."""
    at = (np.arange(96) - 47.5) * CELL
    y, x = np.meshgrid(PLACE.y + at, PLACE.x + at, indexing="ij")
    return np.stack([x, y, np.broadcast_to(heights, x.shape)], axis=-1).reshape(-1, 3).astype(np.float32)


@pytest.mark.parametrize("table_z", [0.0, 0.045])
def test_an_object_rests_on_nearly_the_highest_of_what_is_under_it(workspace: WorkspaceSpec, table_z: float) -> None:
    heights = np.random.default_rng(0).uniform(0.02, 0.04, (96, 96))
    under = heights[44:52, 43:53]
    placement = plan_placement(table(heights), PLACE, GRASP.yaw, GRASP, workspace, table_z)
    assert placement.support_z == pytest.approx(max(float(np.percentile(under, 95.0)), table_z), abs=1e-6)
    assert (placement.x, placement.y, placement.yaw) == (PLACE.x, PLACE.y, GRASP.yaw)


@pytest.mark.parametrize(
    ("above", "opening", "fall"),
    [
        ((-0.1, -0.1, -0.1), 0.05, 0.0),
        ((0.01, 0.0081, 0.0081), 0.05, 0.01),  # 2 mm lower is worth a worse margin
        ((0.01, 0.0079, 0.0079), 0.046, 0.0079),
        ((0.01, 0.0079, 0.0060), 0.046, 0.0079),
        ((0.01, 0.0079, 0.0058), 0.042, 0.0058),
        ((0.01, 0.0085, 0.0079), 0.042, 0.0079),
        ((0.0019, -0.1, -0.1), 0.05, 0.0019),
        ((0.0021, -0.1, -0.1), 0.046, 0.0),
    ],
)
@pytest.mark.parametrize(("tcp_z", "below"), [(0.04, 0.03), (0.018, 0.0095)])
def test_the_widest_opening_is_taken_but_for_one_that_goes_clearly_lower(
    workspace: WorkspaceSpec,
    monkeypatch: pytest.MonkeyPatch,
    above: tuple[float, float, float],
    opening: float,
    fall: float,
    tcp_z: float,
    below: float,
) -> None:
    least = 0.02 + below + 0.003
    given = dict(zip((0.05, 0.046, 0.042), above, strict=True))
    monkeypatch.setattr(
        module, "_above_surroundings", lambda cells, place, yaw, grasp, wide, config: least + given[round(wide, 6)]
    )
    placement = plan_placement(table(0.02), PLACE, 0.7, replace(GRASP, tcp_z=tcp_z), workspace)
    assert placement.opening == pytest.approx(opening) and placement.fall == pytest.approx(fall, abs=1e-7)
    assert placement.tcp_z == pytest.approx(least + fall, abs=1e-7)


def test_the_fingers_open_no_wider_than_they_can(workspace: WorkspaceSpec) -> None:
    wide = replace(GRASP, width=0.07)
    assert plan_placement(table(), PLACE, 0.3, wide, workspace).opening == HAND.opening


@pytest.mark.parametrize(("z", "support"), [(0.2799, 0.2799), (0.2801, -0.1)])
def test_only_depth_within_the_workspaces_heights_counts(workspace: WorkspaceSpec, z: float, support: float) -> None:
    found = plan_placement(table(z), PLACE, 0.3, GRASP, workspace, -0.1)
    assert found.support_z == pytest.approx(support, abs=1e-6)
