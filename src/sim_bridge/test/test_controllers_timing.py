"""What keeps the simulation in time: pacing, and the watch over heartbeats."""

import pytest

from sim_bridge.control.heartbeat import HeartbeatWatchdog
from sim_bridge.pacing import PaceWatch, RealTimePacer

STEP = 1.0 / 240.0


def run(pacer, seconds, wake, cost=0.0, start=0.0):
    """Steps made in `seconds` by a thread that wakes every `wake` s and needs `cost` s a step."""
    now, steps = start, 0
    while now < start + seconds:
        due = pacer.due(now)
        steps += due
        now += max(due * cost, wake)
    return steps


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_follows_wall_time(factor):
    assert run(RealTimePacer(STEP, factor), 10.0, 0.003) == pytest.approx(2400 * factor, abs=6)


def test_catches_up_after_a_short_pause():
    pacer = RealTimePacer(STEP)
    steps = run(pacer, 1.0, 0.003) + run(pacer, 1.0, 0.003, start=1.15)
    assert steps == pytest.approx(240 * 2.15, abs=6)
    assert pacer.dropped == 0.0


def test_a_long_pause_is_dropped():
    pacer = RealTimePacer(STEP)
    steps = run(pacer, 1.0, 0.003) + run(pacer, 1.0, 0.003, start=9.0)
    assert steps == pytest.approx(240 * 2.2, abs=8)
    assert pacer.dropped == pytest.approx(7.8, abs=0.05)


@pytest.mark.parametrize(("factor", "most"), [(0.5, 2), (1.0, 4), (20.0, 4)])
def test_a_batch_is_short_in_wall_and_in_simulated_time(factor, most):
    pacer = RealTimePacer(STEP, factor, max_batch=0.02)
    assert pacer.due(0.0) == 0 and [pacer.due(0.15) for _ in range(4)] == [most] * 4


def test_a_pace_is_said_where_it_is_much_below_what_was_asked_for():
    watch = PaceWatch(2.0)
    assert watch.look(100.0, 50.0) is None, "nothing is known yet"
    assert watch.look(116.1, 60.0) is None
    words = "simulated time runs 1.5 times as fast as real time, not 2 times: this machine is too slow"
    assert watch.look(131.1, 70.0).startswith(words)
    assert watch.look(131.1, 70.0) is None, "no time has passed"
    assert watch.look(151.6, 80.0) is None


def test_too_slow_a_machine_runs_late_but_never_in_ever_larger_batches():
    pacer = RealTimePacer(STEP, max_batch=0.02)
    now, largest = 0.0, 0
    for _ in range(1000):
        due = pacer.due(now)
        largest = max(largest, due)
        now += max(due * 2.0 * STEP, 0.001)
    assert largest <= 5
    assert pacer.dropped > 0.0


def test_delay():
    pacer = RealTimePacer(STEP)
    assert pacer.due(0.0) == 0
    assert pacer.delay(0.001) == pytest.approx(STEP - 0.001)
    assert pacer.delay(1.0) == 0.0


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_factors(factor):
    with pytest.raises(ValueError, match="factor"):
        RealTimePacer(STEP, factor)


class Watch:
    def __init__(self):
        self.dog = HeartbeatWatchdog(timeout=0.25, period=0.03)
        self.now = 0.0

    def run(self, seconds, moving, beats=True):
        """Tick for `seconds`; return when the alarm came, None when it did not."""
        begin, alarm = self.now, None
        next_beat = self.now
        while self.now < begin + seconds:
            if beats and self.now >= next_beat:
                self.dog.beat()
                next_beat += 0.05
            if self.dog.tick(self.now, moving):
                assert alarm is None, "one alarm a silence"
                alarm = self.now - begin
            self.now += 0.03
        return alarm


def test_silence_while_moving():
    watch = Watch()
    assert watch.run(2.0, moving=False) is None
    assert watch.run(2.0, moving=True) is None
    assert watch.run(2.0, moving=True, beats=False) == pytest.approx(0.25, abs=0.07)


def test_silence_at_rest_is_no_fault():
    watch = Watch()
    watch.run(1.0, moving=False)
    assert watch.run(5.0, moving=False, beats=False) is None


def test_drivers_without_heartbeats_are_not_watched():
    watch = Watch()
    assert watch.run(3.0, moving=True, beats=False) is None
    watch.run(1.0, moving=False, beats=True)
    watch.run(5.0, moving=False, beats=False)
    assert watch.run(3.0, moving=True, beats=False) is None


def test_a_driver_that_dies_just_before_the_motion():
    watch = Watch()
    watch.run(1.0, moving=False)
    watch.run(0.5, moving=False, beats=False)
    assert watch.run(1.0, moving=True, beats=False) == pytest.approx(0.25, abs=0.07)


def test_a_driver_that_begins_to_beat_in_its_motion():
    watch = Watch()
    watch.run(0.5, moving=True, beats=False)
    watch.run(0.5, moving=True)
    assert watch.run(1.0, moving=True, beats=False) == pytest.approx(0.25, abs=0.07)


def test_own_stalls_are_not_blamed_on_the_driver():
    watch = Watch()
    watch.run(1.0, moving=True)
    watch.now += 5.0
    assert watch.run(0.15, moving=True, beats=False) is None
    assert watch.run(1.0, moving=True) is None


def test_bad_timeouts():
    with pytest.raises(ValueError, match="timeout"):
        HeartbeatWatchdog(timeout=0.01)
