"""A distribution over rotations says a turn that is finer than its bins."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from cliport_policy.turns import likeliest_turn, split_over


def hills(*hills: tuple[float, float], k: int = 36, width: float = 8.0) -> NDArray[np.float32]:
    """Return shares of k rotations with hills at angles [deg], each with its height."""
    angles = np.arange(k) * 360 / k
    off = [np.remainder(angles - at + 180, 360) - 180 for at, _ in hills]
    mass = sum(height * np.exp(-0.5 * (o / width) ** 2) for (_, height), o in zip(hills, off, strict=True))
    return np.asarray(mass / np.sum(mass), np.float32)


def turn_of(shares: NDArray[np.float32]) -> float:
    return math.degrees(math.remainder(likeliest_turn(shares), 2 * math.pi))


@pytest.mark.parametrize("at", [0.0, 3.0, 55.0, 178.0, 263.4, 357.0])
def test_a_hill_between_two_bins_is_found_where_it_is(at: float) -> None:
    assert math.remainder(turn_of(hills((at, 1.0))) - at, 360) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("times", [2, 3, 4])
def test_all_turns_in_which_a_thing_looks_the_same_are_heard(times: int) -> None:
    off = [-4.0, 5.0, 6.0, 1.0][:times]
    heights = [0.4, 0.35, 0.3, 0.2][:times]
    apart = [(24.0 + i * 360 / times + o, height) for i, (o, height) in enumerate(zip(off, heights, strict=True))]
    mean = sum(o * height for o, height in zip(off, heights, strict=True)) / sum(heights)
    assert turn_of(hills(*apart)) == pytest.approx(24.0 + mean, abs=1.0)


def test_what_lies_elsewhere_and_is_no_symmetry_says_nothing() -> None:
    assert turn_of(hills((40.0, 0.6), (105.0, 0.4))) == pytest.approx(40.0, abs=1.0)
    assert turn_of(hills((0.0, 0.4), (50.0, 0.3), (160.0, 0.3))) == pytest.approx(0.0, abs=1.0)


def test_a_few_bins_say_no_more_than_the_likeliest() -> None:
    for k in (1, 4, 8):
        shares = np.full(k, 1 / k, np.float32)
        shares[-1] += 0.1
        assert likeliest_turn(shares) == pytest.approx((k - 1) * 2 * math.pi / k)


@pytest.mark.parametrize("turn", [0.0, 0.05, 1.3, -0.02, 6.2])
def test_a_turn_that_is_split_over_two_bins_is_found_again(turn: float) -> None:
    shares = np.zeros(36, np.float32)
    for rotation, share in split_over(turn, 36):
        shares[rotation] += share
    assert float(shares.sum()) == pytest.approx(1.0)
    assert math.remainder(likeliest_turn(shares) - turn, 2 * math.pi) == pytest.approx(0.0, abs=1e-5)
