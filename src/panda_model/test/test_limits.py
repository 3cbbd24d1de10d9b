from __future__ import annotations

import numpy as np
import pytest

from panda_model import load_preset
from panda_model.description import load_description
from panda_model.limits import frozen_array

LIMITS = load_preset("panda").limits


def test_limits_hold_their_bounds_and_nothing_beyond() -> None:
    assert LIMITS.contains(LIMITS.lower) and LIMITS.contains(LIMITS.upper)
    for bound, direction in ((LIMITS.lower, -np.inf), (LIMITS.upper, np.inf)):
        for joint in range(7):
            beyond = bound.copy()
            beyond[joint] = np.nextafter(bound[joint], direction)
            assert not LIMITS.contains(beyond)
            assert not LIMITS.contains(np.stack([LIMITS.lower, beyond, LIMITS.upper]))
            assert LIMITS.contains(beyond, tolerance=1e-9)


def test_a_margin_shrinks_either_bound() -> None:
    shrunk = LIMITS.shrunk(0.1)
    np.testing.assert_allclose(shrunk.lower, LIMITS.lower + 0.1)
    np.testing.assert_allclose(shrunk.upper, LIMITS.upper - 0.1)


def test_scaling_multiplies_each_derivative_by_its_own_factor() -> None:
    scaled = LIMITS.scaled(1.0, 0.5, 0.25)
    np.testing.assert_allclose(scaled.velocity, LIMITS.velocity)
    np.testing.assert_allclose(scaled.acceleration, 0.5 * LIMITS.acceleration)
    np.testing.assert_allclose(scaled.jerk, 0.25 * LIMITS.jerk)
    np.testing.assert_array_equal(scaled.lower, LIMITS.lower)


@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("factor", [0.0, -0.5, 1.001])
def test_factors_outside_zero_to_one_are_refused(which: int, factor: float) -> None:
    factors = [1.0, 1.0, 1.0]
    factors[which] = factor
    name = ("velocity", "acceleration", "jerk")[which]
    with pytest.raises(ValueError, match=rf"{name} scaling must be in \(0, 1\], got {factor}"):
        LIMITS.scaled(*factors)


def test_arrays_of_a_model_cannot_be_written() -> None:
    values = np.ones(7)
    kept = frozen_array(values)
    values[0] = 2.0
    assert kept[0] == 1.0
    for array in (kept, LIMITS.lower, LIMITS.scaled(0.5, 0.5, 0.5).jerk, LIMITS.shrunk(0.1).upper):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_descriptions_are_shown_without_their_xml() -> None:
    assert "<" not in repr(load_description(load_preset("panda")))


@pytest.mark.parametrize(
    ("joint", "position", "velocity", "bound"),
    [
        (0, 0.0, 1.0, 2.62),
        (3, -0.2, 0.1, 0.358483),  # sqrt(8 (0.2 - 0.1458)) - 0.3
        (3, -0.2, -0.1, 2.62),
        (5, 0.6, -0.1, 0.456123),  # sqrt(11 (0.6 - 0.54092)) - 0.35
        (1, 1.7837, 0.1, 0.004639),  # sqrt(5.17 (1.7918 - 1.7837)) - 0.2
        (0, 2.7437, 0.1, 1e-3),  # none is allowed there
        (0, 2.9, 0.0, 1e-3),
    ],
)
def test_the_fr3_slows_down_towards_the_ends_of_its_range(
    joint: int, position: float, velocity: float, bound: float
) -> None:
    positions, velocities = load_preset("fr3").ready.copy(), np.zeros(7)
    positions[joint], velocities[joint] = position, velocity
    ratio = load_preset("fr3").limits.velocity_ratio(positions, velocities)
    assert ratio[joint] == pytest.approx(abs(velocity) / bound, rel=1e-4)
    assert not np.delete(ratio, joint).any()


def test_an_arm_without_slow_ends_is_as_fast_everywhere() -> None:
    np.testing.assert_allclose(LIMITS.velocity_ratio(LIMITS.upper, -0.5 * LIMITS.velocity), 0.5)
