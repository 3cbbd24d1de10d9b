"""The search for pinches, on blocks of which it is plain how they can be held."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from cliport_core import PlanarPose
from sim_bridge.objects import Pinch
from sim_bridge.task_mechanics.pinches import FARTHEST, OUTERMOST, gripper_at, search_pinches


def block(width: float, length: float, height: float, x: float = 0.0) -> np.ndarray:
    """Return points on top and sides of a block, half a millimetre apart; width along x, all in mm."""
    across, along = (np.arange(-size / 2 + 0.25, size / 2, 0.5) for size in (width, length))
    top = np.array([(a, b, height) for a in across for b in along])
    levels = np.arange(0.0, height, 2.0)
    sides = [(s * width / 2, b, z) for s in (-0.999, 0.999) for b in along for z in levels]
    ends = [(a, s * length / 2, z) for s in (-0.999, 0.999) for a in across for z in levels]
    return 0.001 * (np.concatenate([top, sides, ends]) + np.array([x, 0.0, 0.0]))


def _off(yaw: float, other: float) -> float:
    """Return how far two directions in which jaws close are apart [rad]."""
    return abs(math.remainder(yaw - other, math.pi))


@pytest.mark.parametrize(
    ("width", "height", "found"),
    [(40, 30, True), (20, 30, True), (65, 30, True), (72, 30, False), (40, 12, False), (40, 16, True)],
)
def test_a_block_is_held_across_its_middle_where_it_is_narrow_and_high_enough(width, height, found: bool) -> None:
    pinches = search_pinches(block(width, 140, height))
    assert bool(pinches) is found
    for best in pinches[:1]:
        assert _off(best.yaw, 0.0) < 0.2 and best.width == pytest.approx(0.001 * width, abs=0.0045)
        assert (best.x, best.y) == pytest.approx((0.0, 0.0), abs=0.003)


def test_pinches_are_sorted_apart_and_few() -> None:
    pinches = search_pinches(block(40, 44, 30))
    assert 2 <= len(pinches) <= 6
    assert _off(pinches[0].yaw, 0.0) < 0.2, "the narrower side is better"
    assert _off(pinches[1].yaw, math.pi / 2) < 0.2
    for one, other in itertools.combinations(pinches, 2):
        assert _off(one.yaw, other.yaw) > math.radians(18.0)
    for pinch in pinches:
        assert math.hypot(pinch.x, pinch.y) < FARTHEST and pinch.width <= 0.068


@pytest.mark.parametrize(("gap", "found"), [(16, False), (40, True)])
def test_the_opened_fingers_need_room_between_two_blocks(gap: float, found: bool) -> None:
    """A finger takes 21 mm beside what it goes round."""
    middle = (gap + 30) / 2
    both = np.concatenate([block(30, 140, 40, -middle), block(30, 140, 40, middle)])
    assert search_pinches(both, FARTHEST) == []
    pinches = search_pinches(both, OUTERMOST)
    assert bool(pinches) is found
    for pinch in pinches[:1]:
        assert abs(pinch.x) == pytest.approx(0.001 * middle, abs=0.004) and pinch.yaw == 0.0


def test_only_the_upper_part_of_a_step_is_held() -> None:
    """A block on a wide slab: the fingers stay above the slab."""
    stepped = np.concatenate([block(110, 140, 15), block(30, 140, 45)])
    best = search_pinches(stepped)[0]
    assert best.yaw == 0.0 and best.width == pytest.approx(0.03, abs=0.0045)
    low = np.concatenate([block(110, 140, 25), block(30, 140, 45)])
    assert search_pinches(low) == [], "the fingertips reach 2.45 cm below the top"


def test_the_gripper_goes_along_with_the_thing() -> None:
    at = gripper_at(PlanarPose(0.4, 0.1, math.pi / 2), Pinch(0.02, 0.01, 0.3, 0.04))
    assert (at.x, at.y, at.yaw) == pytest.approx((0.39, 0.12, math.pi / 2 + 0.3))
