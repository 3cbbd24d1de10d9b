"""How long an owner may be silent, a goal unwatched and a plan unapproved: each limit just below and just above."""

from __future__ import annotations

import threading

import pytest

from panda_executor.approvals import Approvals
from panda_executor.errors import RequestError
from panda_executor.owner_watch import OwnerWatch
from panda_executor.work_pulse import WorkPulse


class Clock:
    """A steady time that the test sets."""

    def __init__(self) -> None:
        self.now = 64.0

    def __call__(self) -> float:
        return self.now


STEP = 1.0 / 32.0  # floats hold it exactly; shorter than a pause of the process itself


def test_an_owner_is_silent_after_longer_than_it_may_be() -> None:
    clock = Clock()
    owners = OwnerWatch(clock, 4.0 * STEP)
    assert owners.longest == 4.0 * STEP
    clock.now += 100.0
    owners.begin("a")
    told = []
    for _ in range(6):
        clock.now += STEP
        told.append(owners.is_silent("a"))
    assert told == [False] * 4 + [True] * 2
    owners.on_beat("a")
    assert owners.is_silent("a"), "a late sign does not revive a goal that was told to end"
    owners.begin("a")
    clock.now += 3.0 * STEP
    owners.is_silent("a")
    owners.on_beat("a")
    clock.now += 2.0 * STEP
    assert not owners.is_silent("a"), "one in time does, and the next goal begins anew"


def test_a_long_pause_between_two_looks_counts_as_a_short_one() -> None:
    clock = Clock()
    owners = OwnerWatch(clock, 0.1)
    owners.begin("a")
    clock.now += 9.0
    assert not owners.is_silent("a")  # 0.06 s
    clock.now += STEP
    assert not owners.is_silent("a")  # 0.09 s
    clock.now += STEP
    assert owners.is_silent("a")


def test_only_the_owner_of_the_goal_that_runs_is_watched() -> None:
    clock = Clock()
    owners = OwnerWatch(clock, 0.01)
    owners.begin("a")
    clock.now += STEP
    assert not owners.is_silent("b") and not owners.is_silent("")
    clock.now += STEP
    assert owners.is_silent("a")
    owners.begin("b")
    clock.now += STEP
    assert not owners.is_silent("a"), "its goal is over"
    clock.now += STEP
    assert owners.is_silent("b")
    owners.begin("")
    owners.on_beat("b")
    clock.now += STEP
    assert not owners.is_silent("b") and not owners.is_silent("")


def test_a_goal_that_runs_must_be_looked_at() -> None:
    clock = Clock()
    pulse = WorkPulse(clock, 0.25)
    clock.now += 9.0
    assert pulse.is_alive(), "nothing runs"
    pulse.begin()
    clock.now += 0.25
    assert pulse.is_alive()
    clock.now += 0.01
    assert not pulse.is_alive()
    pulse.beat()
    assert pulse.is_alive()
    clock.now += 9.0
    assert not pulse.is_alive()
    pulse.end()
    assert pulse.is_alive()


def test_a_goal_that_does_not_end_when_it_is_told_to_is_not_watched() -> None:
    clock = Clock()
    pulse = WorkPulse(clock, 0.25)
    pulse.begin()
    pulse.lapse()
    assert not pulse.is_alive()
    pulse.end()
    assert pulse.is_alive(), "it is over"
    pulse.begin()
    assert pulse.is_alive(), "another one"


def test_a_goal_whose_end_nobody_can_hear_is_not_watched() -> None:
    clock = Clock()
    pulse = WorkPulse(clock, 0.25)
    pulse.turn()
    pulse.begin()
    clock.now += 0.25
    pulse.beat()
    assert pulse.is_alive()
    clock.now += 0.01
    pulse.beat()
    assert not pulse.is_alive(), "the thread that spins stands"
    pulse.turn()
    assert pulse.is_alive()
    clock.now += 9.0
    pulse.turn()
    assert not pulse.is_alive(), "the thread that watches stands"


def test_an_approval_in_time_lets_the_plan_go_and_one_afterwards_finds_none() -> None:
    clock = Clock()
    approvals = Approvals(2.0, clock)
    looks: list[float] = []

    def pass_time() -> bool:
        clock.now += 1.0
        return False

    def approve_late() -> bool:
        looks.append(clock.now)
        if len(looks) == 2:
            clock.now += 2.0  # as late as it may be
        if len(looks) == 4:
            assert approvals.approve("other") == (False, "the plan that waits is plan-1, not other")
            assert approvals.approve("") == (False, "the plan that waits is plan-1, not one without an id")
            assert approvals.approve("plan-1") == (True, "plan plan-1 is approved")
        return False

    approvals.offer("plan-1")
    approvals.wait("plan-1", approve_late)
    assert len(looks) == 4
    assert approvals.approve("plan-1") == (False, "no plan waits for approval")
    approvals.offer("plan-1")
    clock.now += 9.0
    with pytest.raises(RequestError):
        approvals.wait("plan-1", pass_time)


def test_a_plan_that_nobody_approved_is_refused_with_the_time_it_had() -> None:
    clock = Clock()
    approvals = Approvals(2.5, clock)
    approvals.offer("plan-1")

    def pass_time() -> bool:
        clock.now += 1.25
        return False

    with pytest.raises(RequestError) as caught:
        approvals.wait("plan-1", pass_time)
    assert clock.now == 64.0 + 3 * 1.25
    assert (caught.value.value, caught.value.limit) == (2.5, 2.5)
    assert str(caught.value) == (
        "plan plan-1 was not approved within 2.5 s (service /panda_executor/approve); nothing moved"
    )
    assert approvals.approve("plan-1") == (False, "no plan waits for approval"), "it would be approved for nothing"


def test_a_wait_is_ended_by_an_approval_from_another_thread() -> None:
    approvals = Approvals(60.0)
    approvals.offer("plan-1")
    waits = threading.Event()

    def look() -> bool:
        waits.set()
        return False

    def approve() -> None:
        assert waits.wait(20.0)
        assert approvals.approve("plan-1")[0]

    thread = threading.Thread(target=approve)
    thread.start()
    approvals.wait("plan-1", look)
    thread.join(20.0)
    assert not thread.is_alive()
