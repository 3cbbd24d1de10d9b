"""The guard tick by tick: each limit just below and just above, in numbers that floats hold exactly."""

from __future__ import annotations

import math

import pytest

from panda_executor.guard import Fault, Guard, GuardConfig

PERIOD = 0.125
CONFIG = GuardConfig(
    silence=0.5, joint_silence=0.75, max_age=1.0, max_ahead=0.25, moving=0.5, still_for=1.0, repeat=0.375
)


class Bench:
    """A guard over joints a and b that has heard the executor; `a` goes to and fro while it moves."""

    def __init__(self, config: GuardConfig = CONFIG) -> None:
        self.guard, self.now, self.at = Guard(config, PERIOD, ("a", "b")), 100.0, 0.0
        self.guard.on_joints(("a", "b"), (0.0, 0.0), 0.0)
        self.guard.on_heartbeat()

    def ticks(
        self, number: int, beats: bool = False, joints: bool = False, moves: bool = False, age: float = 0.0
    ) -> list[Fault | None]:
        faults = []
        for _ in range(number):
            if beats:
                self.guard.on_heartbeat()
            if moves:
                self.at = 1.0 - self.at
            if joints or moves:
                self.guard.on_joints(("b", "a"), (0.0, self.at), age)
            self.now += PERIOD
            faults.append(self.guard.tick(self.now))
        return faults


def test_the_defaults_are_those_that_the_documentation_names() -> None:
    config = GuardConfig()
    assert (config.silence, config.joint_silence, config.max_age, config.max_ahead) == (0.2, 0.3, 0.5, 0.25)
    assert (config.moving, config.still_for, config.repeat) == (0.0005, 0.3, 0.5)


def test_silence_counts_from_the_last_sign_and_is_told_again_in_turn() -> None:
    bench = Bench()
    silent = Fault.EXECUTOR_SILENT
    assert bench.ticks(8, moves=True) == [None] * 4 + [silent, None, None, silent]
    assert bench.ticks(6, moves=True, beats=True) == [None] * 6
    assert bench.ticks(4, moves=True) == [None] * 3 + [silent]  # the last sign came a tick ago


def test_joint_states_that_end_while_the_arm_moves_are_missed_for_as_long_as_they_are_away() -> None:
    bench = Bench()
    bench.ticks(1, moves=True, beats=True)
    lost = Fault.JOINT_STATES_LOST
    assert bench.ticks(11, beats=True) == [None] * 4 + [lost, None, None] * 2 + [lost]
    assert bench.guard.moving, "an arm that nobody sees is not known to rest"
    assert bench.ticks(4, beats=True, joints=True) == [None] * 4


def test_an_arm_rests_once_nothing_moved_for_a_while() -> None:
    bench = Bench()
    assert not bench.guard.moving
    bench.ticks(1, moves=True)
    for tick in range(2, 12):
        bench.ticks(1, joints=True)
        assert bench.guard.moving is (tick * PERIOD < CONFIG.still_for), tick


@pytest.mark.parametrize(
    ("way", "moving"),
    [([0.5], False), ([0.51], True), ([-0.5], False), ([-0.51], True), ([0.3, 0.6], True), ([0.3, 0.0, -0.3], False)],
)
def test_a_joint_moves_once_it_is_far_enough_from_where_it_was(way: list[float], moving: bool) -> None:
    bench = Bench()
    for at in way:
        bench.guard.on_joints(("a",), (at,), 0.0)
    assert bench.guard.moving is moving


def test_where_it_last_moved_to_is_what_a_joint_is_compared_with() -> None:
    bench = Bench()
    bench.at = 1.0
    bench.ticks(10, joints=True)
    assert not bench.guard.moving
    bench.guard.on_joints(("a",), (0.6,), 0.0)
    assert not bench.guard.moving, "0.4 from where it stood, 0.6 from where it began"


def test_each_joint_is_compared_with_itself() -> None:
    guard = Guard(CONFIG, PERIOD, ("a", "b"))
    for _ in range(3):
        guard.on_joints(("a", "b"), (0.0, 5.0), 0.0)
        guard.on_joints(("b", "a"), (5.0, 0.0), 0.0)
    assert not guard.moving


@pytest.mark.parametrize(
    ("age", "fault"),
    [
        (1.0, None),
        (1.001, Fault.JOINT_STATES_OLD),
        (-0.25, None),
        (-0.251, Fault.JOINT_STATES_AHEAD),
        (0.0, None),
    ],
)
def test_stamps_may_be_off_by_so_much(age: float, fault: Fault | None) -> None:
    assert Bench().ticks(1, beats=True, moves=True, age=age) == [fault]


def test_what_is_worst_is_named_first() -> None:
    bench = Bench(GuardConfig(silence=0.2, joint_silence=0.3, max_age=1.0, moving=0.5, still_for=9.0, repeat=0.0))
    bench.ticks(1, beats=True, moves=True, age=2.0)
    assert bench.ticks(3) == [Fault.EXECUTOR_SILENT] * 3
    bench.guard.on_heartbeat()
    assert bench.ticks(1) == [Fault.JOINT_STATES_LOST]
    bench.guard.on_joints(("a", "b"), (1.0, 0.0), 2.0)
    assert bench.ticks(1, beats=True) == [Fault.JOINT_STATES_OLD]


def test_a_pause_of_its_own_counts_as_two_ticks_at_most() -> None:
    bench = Bench()
    bench.ticks(1, beats=True, moves=True)
    bench.now += 50.0
    assert bench.ticks(1) == [None]
    assert bench.guard._since_beat == bench.guard._since_joints == PERIOD + 2.0 * PERIOD
    bench.now -= PERIOD / 2.0  # a tick that comes early counts as what passed
    bench.ticks(1)
    assert bench.guard._since_beat == 3.5 * PERIOD


def test_the_first_tick_counts_as_one() -> None:
    for config, faults in ((CONFIG, [None]), (GuardConfig(silence=0.12), [Fault.EXECUTOR_SILENT])):
        bench = Bench(config)
        assert bench.ticks(1, moves=True) == faults


def test_the_states_are_whole_once_each_joint_of_the_arm_was_heard() -> None:
    bench = Bench()
    bench.ticks(1, beats=True, moves=True)
    heard = []
    for name in ("a", "finger", "a", "b", "b", "b"):
        bench.guard.on_joints((name,), (0.0,), 0.0)
        bench.ticks(1, beats=True)
        heard.append(bench.guard._since_joints)
    assert heard == [n * PERIOD for n in (2, 3, 4, 1, 2, 3)]


def test_a_position_that_is_not_finite_hides_no_other() -> None:
    bench = Bench()
    bench.ticks(1, beats=True, moves=True)
    bench.guard.on_joints(("a", "b"), (math.nan, 0.9), 0.0)
    assert bench.guard._since_motion == 0.0
    assert bench.guard._awaited == {"a"}


def test_any_message_will_do_where_no_joints_are_named() -> None:
    guard = Guard(CONFIG, PERIOD)
    guard.on_joints(("x",), (0.0,), 0.5)
    assert (guard._since_joints, guard._age) == (0.0, 0.5)
