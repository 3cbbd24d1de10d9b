"""ROS time beside a steady clock: what is a jump, what a correction, and what a delivery that was held up."""

from __future__ import annotations

import pytest

from panda_executor.clock_watch import ClockWatch
from panda_executor.errors import PortError


@pytest.mark.parametrize("simulated", [True, False])
@pytest.mark.parametrize(("step", "words"), [(10.0, "10.0 s ahead"), (-10.0, "10.0 s back"), (-0.26, "0.3 s back")])
def test_a_jump_is_named(simulated: bool, step: float, words: str) -> None:
    watch = ClockWatch(100.0, 5.0, simulated)
    assert watch.look(100.01, 5.01) == pytest.approx(0.01)
    with pytest.raises(PortError, match=words):
        watch.look(100.02 + step, 5.02)


@pytest.mark.parametrize("step", [-0.24, 0.4])
def test_a_correction_is_no_jump(step: float) -> None:
    watch = ClockWatch(100.0, 5.0, simulated=False)
    assert watch.look(100.0 + step, 5.01) == pytest.approx(step)
    assert watch.look(100.01 + step, 5.02) == pytest.approx(0.01)


def test_a_simulator_may_be_fast_and_its_clock_may_come_late() -> None:
    """Twenty times real time; for half a second nothing is delivered, although there are looks."""
    watch = ClockWatch(100.0, 5.0, simulated=True)
    for number in range(1, 50):
        assert watch.look(100.0 + 0.2 * number, 5.0 + 0.01 * number) == pytest.approx(0.2)
    for number in range(50, 100):
        assert watch.look(109.8, 5.0 + 0.01 * number) == 0.0
    assert watch.look(120.0, 6.0) == pytest.approx(10.2)


def test_the_machines_own_clock_is_not_so_fast() -> None:
    watch = ClockWatch(100.0, 5.0, simulated=False)
    watch.look(100.9, 5.5)  # held up, and corrected
    with pytest.raises(PortError, match=r"3\.0 s ahead"):
        watch.look(103.9, 6.0)


def test_how_long_it_stands_is_told() -> None:
    watch = ClockWatch(100.0, 5.0, simulated=True)
    assert watch.stood_for(5.5) == 0.5
    watch.look(100.0, 6.0)
    assert watch.stood_for(6.0) == 1.0
    watch.look(100.1, 7.0)
    assert watch.stood_for(7.25) == 0.25
