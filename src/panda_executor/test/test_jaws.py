"""The fingers over cells that were drawn by hand: every length of a hold, and the room that they need."""

from __future__ import annotations

import math

import pytest
from height_grids import CELL, ground, mask

from panda_executor.errors import GraspError
from panda_executor.ground_cells import GroundCells
from panda_executor.jaws import Hold, JawConfig, Jaws
from panda_model import load_preset

HAND = load_preset().hand
CONFIG = JawConfig()
TALL = 0.06  # height of the block [m]
BLOCK = (-6, 8, -3, 5, TALL)  # 35 mm between its outer cells' middles along x, 20 mm along y
PART = mask(-6, 8, -3, 5)
WIDTH, MIDDLE, ACROSS = 14 * CELL, CELL, CELL


def hold(cells: GroundCells, height: float = 0.03, yaw: float = 0.0, floor: float = 0.0, table: float = 0.0) -> Hold:
    return Jaws(cells, 0.0, 0.0, yaw, floor, table, CONFIG).on_object(PART, height, "here")


@pytest.mark.parametrize("yaw", [0.0, math.pi])
def test_a_hold_is_on_the_outsides_of_the_part(yaw: float) -> None:
    held = hold(ground(BLOCK), yaw=yaw)
    turned = math.cos(yaw)
    assert [held.middle, held.across] == pytest.approx([turned * MIDDLE, turned * ACROSS])
    assert held.width == pytest.approx(WIDTH)
    assert held.opening == HAND.opening
    assert held.tips == pytest.approx(0.03 - HAND.fingertip_below_tcp)
    assert held.spare == pytest.approx(TALL - CONFIG.least_insertion - held.tips)


def test_a_turned_hold_closes_along_y() -> None:
    held = hold(ground(BLOCK), yaw=math.pi / 2)
    assert held.width == pytest.approx(8 * CELL) and held.middle == pytest.approx(CELL)
    assert held.across == pytest.approx(-CELL)  # x is to the right of y


@pytest.mark.parametrize(
    ("top", "height", "floor", "table", "tips"),
    [
        (0.06, 0.03, 0.0, 0.0, 0.03 - HAND.fingertip_below_tcp),
        (0.06, 0.055, 0.0, 0.0, 0.06 - CONFIG.min_insertion - HAND.fingertip_below_tcp),
        (0.04, 0.0, 0.0, 0.0, CONFIG.tip_clearance),
        (0.04, 0.0, 0.0, 0.01, 0.01 + CONFIG.tip_clearance),
        (0.06, 0.0, 0.03, 0.0, 0.03 + 0.0045),
    ],
)
def test_the_fingertips_go_as_deep_as_table_and_floor_allow(
    top: float, height: float, floor: float, table: float, tips: float
) -> None:
    held = hold(ground((*BLOCK[:4], top)), height, floor=floor, table=table)
    assert held.tips == pytest.approx(tips)
    assert held.spare == pytest.approx(top - CONFIG.least_insertion - tips)


def test_a_flat_part_is_held_as_low_as_the_table_lets_it() -> None:
    held = hold(ground((*BLOCK[:4], 0.01)), 0.005)
    assert held.tips == pytest.approx(CONFIG.tip_clearance) and held.spare == 0.0


def beside(gap: int, height: float = 0.1, rows: tuple[int, int] = (-3, 5)) -> GroundCells:
    """Return the block with a neighbour `gap` empty cells to its right, four cells wide."""
    return ground(BLOCK, (9 + gap, 12 + gap, *rows, height))


def free(gap: int, thickness: float = HAND.finger_thickness) -> float:
    """Return the room that is left beyond the finger between block and neighbour [m]."""
    return (gap + 1) * CELL - CELL / 2 - thickness


@pytest.mark.parametrize("gap", [8, 9, 10, 11])
def test_the_fingers_open_as_far_as_a_neighbour_lets_them(gap: int) -> None:
    """A low neighbour meets the pads only: higher than the tips, lower than the mounts."""
    held = hold(beside(gap, 0.045))
    room = free(gap)
    assert held.tips == pytest.approx(0.03 - HAND.fingertip_below_tcp)
    assert held.opening == pytest.approx(min(WIDTH + 2 * max(room - 0.005, room / 2), HAND.opening))


def test_the_fingers_stay_above_a_neighbour_that_leaves_them_no_room() -> None:
    """Of 7 empty cells 3.55 mm are left beside the finger, of 6 1.05: less than its play and margin."""
    assert free(7) < HAND.finger_slack + CONFIG.finger_margin < free(8)
    for gap, room in ((7, False), (8, True)):
        held = hold(beside(gap, 0.03))
        lowest = 0.03 - HAND.fingertip_below_tcp
        if room:
            assert held.tips == pytest.approx(lowest)
        else:  # raised in steps of 2 mm until the neighbour is no higher than the margin above the tips
            assert held.tips == pytest.approx(lowest + 6 * 0.002)
            assert held.opening == HAND.opening
            assert held.spare == pytest.approx(TALL - CONFIG.least_insertion - held.tips)


def test_the_mounts_are_thicker_than_the_pads() -> None:
    """They begin 33 mm above the tips: what is higher than that, less the margin, keeps 26 mm off."""
    under = 0.03 - HAND.fingertip_below_tcp + HAND.fingertip_below_tcp + HAND.mount_above_tcp - CONFIG.finger_margin
    gap = 12
    low, high = hold(beside(gap, under - 1e-4)), hold(beside(gap, under + 1e-4))
    assert low.opening == pytest.approx(min(WIDTH + 2 * (free(gap) - 0.005), HAND.opening))
    room = free(gap, HAND.mount_thickness)
    assert high.opening == pytest.approx(WIDTH + 2 * max(room - 0.005, room / 2)) and high.opening < low.opening


def test_a_lone_cell_stops_no_finger_and_two_do() -> None:
    alone = hold(ground(BLOCK, (12, 12, 1, 1, 0.03)))
    assert alone.tips == pytest.approx(0.03 - HAND.fingertip_below_tcp) and alone.opening == HAND.opening
    two = hold(ground(BLOCK, (12, 12, 1, 2, 0.03)))
    assert two.tips > alone.tips


def test_what_lies_beside_the_fingers_width_is_passed() -> None:
    """The fingers are 21 mm wide and keep 2 mm: they stand 12.5 mm to either side of the middle, in y from 2.5."""
    wide = HAND.finger_half_width + CONFIG.finger_margin
    first = math.ceil((wide + ACROSS) / CELL)  # row of the first cell beyond
    assert hold(beside(5, 0.03, (first, first + 8))).opening == HAND.opening
    assert hold(beside(5, 0.03, (first - 2, first + 8))).tips > 0.03 - HAND.fingertip_below_tcp


def test_a_part_too_wide_is_refused_with_its_width() -> None:
    for cells, fits in ((30, True), (31, False)):  # 75 and 77.5 mm between the outer cells' middles
        part = mask(0, cells, -3, 5)
        jaws = Jaws(ground((0, cells, -3, 5, TALL)), 0.0, 0.0, 0.0, 0.0, 0.0, CONFIG)
        if fits:
            assert jaws.on_object(part, 0.03, "here").width == pytest.approx(HAND.widest)
        else:
            with pytest.raises(GraspError, match=r"object at here is 78 mm wide .*, 75 mm is the most"):
                jaws.on_object(part, 0.03, "here")


@pytest.mark.parametrize(
    ("block", "in_the_way"),
    [
        ((41, 45, -3, 5), True),  # the palm reaches 103 mm along: to cell 42 from its middle at cell 1
        ((43, 48, -3, 5), False),
        ((-45, -40, -3, 5), True),
        ((-48, -41, -3, 5), False),
        ((-6, 8, 13, 20), True),  # and 32 mm across: to cell 13 from cell 1
        ((-6, 8, 14, 20), False),
        ((-6, 8, -20, -11), True),
        ((-6, 8, -20, -12), False),
    ],
)
def test_what_is_higher_under_the_palm_is_in_the_way(block: tuple[int, int, int, int], in_the_way: bool) -> None:
    cells = ground(BLOCK, (*block, 0.15))
    if in_the_way:
        with pytest.raises(GraspError, match=r"within 103 mm of the object at here is 90 mm higher than it and in"):
            hold(cells)
    else:
        assert hold(cells).width == pytest.approx(WIDTH)


def test_the_palm_stays_above_the_part_itself() -> None:
    """A block of 90 mm, held low, would touch the palm, which is 47 mm above the tips: the hold goes up."""
    held = hold(ground((*BLOCK[:4], 0.09)), 0.03)
    least = 0.09 + CONFIG.palm_clearance - HAND.finger_length
    assert least <= held.tips < least + 0.002


def test_there_must_be_something_at_the_middle() -> None:
    """The strip between the fingers, 21 mm wide at the centroid of two far parts, is empty."""
    two = mask(-3, 3, -20, -15) | mask(-3, 3, 15, 20)
    jaws = Jaws(ground((-3, 3, -20, -15, TALL), (-3, 3, 15, 20, TALL)), 0.0, 0.0, 0.0, 0.0, 0.0, CONFIG)
    with pytest.raises(GraspError, match="nothing between the fingers at the middle of the object at here"):
        jaws.on_object(two, 0.03, "here")


RIM = (-2, 1, -20, 20, 0.05)
WHOLE = mask(-2, 1, -20, 20)


def feature(cells: GroundCells, reach: float = 0.01, height: float = 0.02) -> Hold | None:
    return Jaws(cells, 0.0, 0.0, 0.0, 0.0, 0.0, CONFIG).on_feature(WHOLE, reach, height, "here")


def test_a_feature_is_held_where_the_pick_is() -> None:
    held = feature(ground(RIM))
    assert held is not None
    assert held.middle == pytest.approx(-CELL / 2) and held.width == pytest.approx(3 * CELL) and held.across == 0.0
    assert held.tips == pytest.approx(0.02 - HAND.fingertip_below_tcp) and held.opening == HAND.opening


@pytest.mark.parametrize(("column", "reach", "found"), [(4, 0.0101, True), (4, 0.0099, False), (-4, 0.0101, True)])
def test_a_feature_is_no_farther_from_the_pick_than_its_reach(column: int, reach: float, found: bool) -> None:
    left, right = (column, column + 3) if column > 0 else (column - 3, column)
    part = mask(left, right, 0, 5)
    cells = ground((left, right, 0, 5, 0.05), unseen=((left - 1, left - 1, -9, 9), (right + 1, right + 1, -9, 9)))
    held = Jaws(cells, 0.0, 0.0, 0.0, 0.0, 0.0, CONFIG).on_feature(part, reach, 0.02, "here")
    assert (held is not None) == found
    if held is not None:
        assert held.middle == pytest.approx((left + right) / 2 * CELL)


@pytest.mark.parametrize(("gap", "width"), [(8, 3), (7, 13)])
def test_a_gap_into_which_no_finger_fits_parts_nothing(gap: int, width: int) -> None:
    """A finger with its play is 20.2 mm thick, 8.08 cells: two runs are apart when more lies between them."""
    first = 2 + gap
    whole = WHOLE | mask(first, first + 2, -20, 20)
    cells = ground(RIM, (first, first + 2, -20, 20, 0.05))
    held = Jaws(cells, 0.0, 0.0, 0.0, 0.0, 0.0, CONFIG).on_feature(whole, 0.01, 0.02, "here")
    assert held is not None and held.width == pytest.approx(width * CELL)


@pytest.mark.parametrize(("foot", "width"), [(5, 7), (6, 3)])
def test_a_feature_may_be_a_little_wider_below(foot: int, width: int) -> None:
    """Ten millimetres more at the fingertips belong to it; what is wider there is something else."""
    whole = mask(-2, foot, -20, 20)
    cells = ground((-2, foot, -20, 20, 0.03), RIM)
    held = Jaws(cells, 0.0, 0.0, 0.0, 0.0, 0.0, CONFIG).on_feature(whole, 0.01, 0.02, "here")
    assert held is not None and held.width == pytest.approx(width * CELL)


@pytest.mark.parametrize("side", [(9, 9, -3, 5), (-7, -7, -3, 5)])
def test_the_cells_right_beside_a_part_are_its_own(side: tuple[int, int, int, int]) -> None:
    """Its outermost points fall into them: a lower edge there is no neighbour that the fingers must avoid."""
    held = hold(ground(BLOCK, (*side, 0.045)))
    assert held.tips == pytest.approx(0.03 - HAND.fingertip_below_tcp) and held.opening == HAND.opening
