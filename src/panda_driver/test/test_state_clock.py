"""Ages of states by the arm's own clock."""

from __future__ import annotations

import pytest

from panda_driver.state_clock import StateClock


def test_a_state_that_was_held_up_is_older_than_one_that_was_not() -> None:
    clock = StateClock()
    assert clock.age(100.0, 7.0) == 0.0
    assert clock.age(100.1, 7.1) == pytest.approx(0.0, abs=1e-3)
    assert clock.age(100.2, 7.9) == pytest.approx(0.7, abs=2e-3)  # 0.7 s on its way
    assert clock.age(100.9, 7.9) == pytest.approx(0.0, abs=2e-3)


def test_a_state_that_came_before_has_no_new_age() -> None:
    clock = StateClock()
    clock.age(100.0, 7.0)
    assert clock.age(100.0, 7.5) is None
    assert clock.age(100.5, 7.6) == pytest.approx(0.1, abs=2e-3)


def test_no_age_is_negative_and_a_drifting_clock_is_followed() -> None:
    clock, ages = StateClock(), list[float]()
    for step in range(10_000):
        now = 0.01 * step
        age = clock.age(50.0 + 0.9999 * now, now)
        assert age is not None
        ages.append(age)
    assert min(ages) >= 0.0 and max(ages) < 1e-4


def test_a_clock_that_is_slower_than_drift_makes_states_old() -> None:
    clock, age = StateClock(), None
    for step in range(1000):
        age = clock.age(0.003 * step, 0.01 * step)
    assert age is not None and age > 5.0


def test_an_arm_that_began_anew_is_followed() -> None:
    clock = StateClock()
    clock.age(5000.0, 7.0)
    assert clock.age(2.0, 9.0) == 0.0
    assert clock.age(2.5, 9.6) == pytest.approx(0.1, abs=2e-3)
