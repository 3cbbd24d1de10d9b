"""When the guard cancels everything: never without a motion, soon after a fault, never for its own pauses."""

from __future__ import annotations

import math

import pytest

from panda_executor.guard import Fault, Guard, GuardConfig

PERIOD = 0.02
CONFIG = GuardConfig()


class Bench:
    """A guard, ticked every 20 ms, and what it hears in between."""

    def __init__(self) -> None:
        self.guard, self.now, self.angle = Guard(CONFIG, PERIOD, ("a", "b")), 0.0, 0.0
        self.cancels: list[tuple[float, Fault]] = []

    def run(
        self,
        seconds: float,
        beats: bool = True,
        joints: bool = True,
        speed: float = 0.0,
        age: float = 0.01,
        rate: int = 50,
    ) -> None:
        """Let time pass with so many joint states a second; the hand's own come all the time."""
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            if beats:
                self.guard.on_heartbeat()
            for _ in range(round(rate * PERIOD)):
                self.angle += speed / rate
                if joints:
                    self.guard.on_joints(("b", "a"), (0.0, self.angle), age)
            self.guard.on_joints(("finger",), (0.02,), 0.01)
            fault = self.guard.tick(self.now)
            if fault is not None:
                self.cancels.append((self.now, fault))


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.run(1.0)
    return bench


def test_a_motion_that_is_watched_is_let_be(bench: Bench) -> None:
    bench.run(3.0, speed=0.5)
    assert bench.cancels == []


@pytest.mark.parametrize(
    ("loss", "fault"),
    [
        ({"beats": False}, Fault.EXECUTOR_SILENT),
        ({"joints": False}, Fault.JOINT_STATES_LOST),
        ({"age": 0.9}, Fault.JOINT_STATES_OLD),
        ({"age": -0.9}, Fault.JOINT_STATES_AHEAD),
    ],
)
def test_a_motion_without_an_owner_is_cancelled_soon(bench: Bench, loss: dict[str, float], fault: Fault) -> None:
    bench.run(1.0, speed=0.5)
    lost = bench.now
    bench.run(0.4, speed=0.5, **loss)  # type: ignore[arg-type]
    assert [what for _, what in bench.cancels] == [fault]
    assert bench.cancels[0][0] - lost <= 0.35


@pytest.mark.parametrize("rate", [50, 1000])
@pytest.mark.parametrize("speed", [0.02, 0.1, 0.3])
def test_a_slow_motion_is_one_at_any_rate_of_joint_states(bench: Bench, rate: int, speed: float) -> None:
    """Compared from message to message, an arm at 0.3 rad/s seems to stand still from 600 messages a second on."""
    bench.run(1.0, speed=speed, rate=rate)
    assert bench.guard.moving
    bench.run(0.4, beats=False, speed=speed, rate=rate)
    assert [what for _, what in bench.cancels] == [Fault.EXECUTOR_SILENT]


def test_half_of_the_arm_is_not_the_arm(bench: Bench) -> None:
    bench.run(0.5, speed=0.5)
    for _ in range(20):
        bench.guard.on_joints(("a",), (bench.angle,), 0.01)
        bench.run(PERIOD, joints=False)
    assert [what for _, what in bench.cancels] == [Fault.JOINT_STATES_LOST]


def test_positions_that_are_not_finite_blind_nobody(bench: Bench) -> None:
    """A driver reports NaN until its hardware is up."""
    guard = Guard(CONFIG, PERIOD, ("a",))
    guard.on_joints(("a",), (math.nan,), 0.01)
    guard.on_joints(("a",), (0.0,), 0.01)
    guard.on_joints(("a",), (0.1,), 0.01)
    assert guard.moving


def test_it_cancels_again_while_the_arm_goes_on(bench: Bench) -> None:
    bench.run(0.5, speed=0.5)
    bench.run(2.0, beats=False, speed=0.5)
    assert len(bench.cancels) == 4


@pytest.mark.parametrize("loss", [{"beats": False}, {"joints": False}, {"age": 0.9}])
def test_an_arm_that_stands_still_needs_nobody(bench: Bench, loss: dict[str, float]) -> None:
    bench.run(0.5, speed=0.5)
    bench.run(0.5)
    bench.run(3.0, **loss)  # type: ignore[arg-type]
    assert bench.cancels == []


def test_its_own_pause_blames_nobody(bench: Bench) -> None:
    bench.run(0.5, speed=0.5)
    bench.now += 5.0
    bench.run(0.5, speed=0.5)
    assert bench.cancels == []


def test_an_executor_that_was_never_heard_is_not_watched() -> None:
    bench = Bench()
    bench.run(2.0, beats=False, speed=0.5)
    assert bench.cancels == []
