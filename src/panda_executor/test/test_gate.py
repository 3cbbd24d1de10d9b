"""Who may start, when, and what a stop ends."""

from __future__ import annotations

from panda_executor.gate import Gate

SHUT = "the executor is shutting down"
BUSY = "another goal is being executed"
STOPPED = "stopped on request; call /panda_executor/resume first"
MOVES = "the arm was not seen to stand still since its last motion; are its joint states coming in, and do they change "


class Arm:
    """Whether it is measured at rest, and how often that was asked."""

    def __init__(self) -> None:
        self.rests, self.asked = True, 0

    def at_rest(self) -> bool:
        self.asked += 1
        return self.rests


def test_one_request_runs_at_a_time() -> None:
    gate = Gate()
    assert (gate.busy, gate.stopped, gate.refusal()) == (False, False, None)
    assert gate.enter() is None
    assert (gate.busy, gate.stopped, gate.refusal()) == (True, False, BUSY)
    assert gate.enter() == BUSY and gate.busy
    gate.leave()
    assert (gate.busy, gate.refusal(), gate.enter()) == (False, None, None)


def test_a_request_that_was_refused_does_not_run() -> None:
    gate = Gate()
    gate.latch("stopped on request")
    assert gate.enter() == STOPPED
    assert not gate.busy


def test_a_stop_holds_until_its_release_and_ends_what_ran_for_good() -> None:
    gate = Gate()
    assert gate.enter() is None
    gate.latch("stopped on request")
    assert gate.stopped and gate.refusal() == STOPPED
    gate.release()
    assert gate.stopped, "a release revives nothing"
    assert gate.refusal() == BUSY
    gate.leave()
    assert not gate.stopped and gate.enter() is None
    assert not gate.stopped, "the next request has nothing to do with that stop"
    gate.leave()


def test_a_stop_while_nothing_runs_does_not_end_the_next_request() -> None:
    gate = Gate()
    for _ in range(2):
        gate.latch("first")
        gate.latch("stopped on request")
        assert gate.stopped and gate.refusal() == STOPPED
        gate.release()
        assert not gate.stopped and gate.enter() is None
        assert not gate.stopped
        gate.latch("again")
        gate.release()
        assert gate.stopped, "each stop counts"
        gate.leave()


def test_nothing_starts_after_the_end() -> None:
    gate = Gate()
    assert gate.enter() is None
    gate.close()
    assert gate.stopped and gate.refusal() == SHUT
    gate.leave()
    gate.latch("stopped on request")
    assert gate.refusal() == SHUT, "a resume would not help"
    gate.release()
    assert gate.stopped and gate.enter() == SHUT and not gate.busy


def test_the_request_after_a_motion_waits_for_a_standstill() -> None:
    arm = Arm()
    gate = Gate(arm.at_rest)
    arm.rests = False
    assert gate.enter() is None and arm.asked == 0, "before the first motion nothing is asked of the arm"
    gate.note_motion()
    gate.leave()
    refusal = gate.enter()
    assert refusal is not None and refusal.startswith(MOVES) and not gate.busy
    arm.rests = True
    assert gate.refusal() is None
    arm.rests = False
    assert gate.enter() is None, "it was seen at rest since"
    assert gate.refusal() == BUSY


def test_a_rest_at_the_end_of_a_request_is_enough() -> None:
    arm = Arm()
    gate = Gate(arm.at_rest)
    for _ in range(2):
        assert gate.enter() is None
        gate.note_motion()
        arm.rests = True
        gate.leave()
        arm.rests = False
        assert gate.refusal() is None
    assert gate.enter() is None
    gate.leave()
    assert gate.refusal() is None, "nothing was told to move"
