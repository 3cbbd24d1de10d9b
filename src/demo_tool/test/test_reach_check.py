"""Whether the arm can do what is drawn is asked by itself, and keeps nothing waiting."""

from __future__ import annotations

import pytest

from cliport_core.outcome import Outcome

YES = {"reachable": True, "words": "a way was found"}


def live(bench, seconds: float) -> None:
    """Time passes, with pictures."""
    for number in range(round(20 * seconds)):
        if number % 10 == 9:
            bench.see()
        bench.wait(0.05)


@pytest.fixture
def drawn(bench):
    bench.begin()
    bench.draw()
    return bench


def test_it_is_asked_once_when_the_drawing_was_left_alone(drawn) -> None:
    live(drawn, 0.2)
    assert not drawn.arm.checks and drawn.view["plan"] is None
    live(drawn, 0.2)
    (goal,) = drawn.arm.checks
    assert goal.plan_only and not drawn.arm.goals
    last = drawn.view["last"]
    assert drawn.view["plan"] == YES and drawn.state == "ready"
    live(drawn, 3.0)
    assert len(drawn.arm.checks) == 1 and drawn.view["last"] == last, "nothing is announced"


def test_another_drawing_is_asked_about_anew(drawn) -> None:
    drawn.arm.holds_checks = True
    live(drawn, 0.4)
    first = drawn.arm.end_check
    drawn.do("place", box=drawn.table.box_at(0.45, -0.25), rotation=3)
    live(drawn, 0.05)
    assert drawn.arm.cancelled_checks == 1
    first()
    assert drawn.view["plan"] is None, "that was about the drawing before"
    live(drawn, 0.4)
    assert len(drawn.arm.checks) == 2
    drawn.arm.end_check(Outcome.PLANNING_FAILED)
    assert drawn.view["plan"]["reachable"] is False and drawn.state == "ready", "it is no failure"


def test_a_motion_does_not_wait_where_nothing_is_asked(drawn) -> None:
    drawn.do("execute")
    assert len(drawn.arm.goals) == 1 and not drawn.arm.checks


def test_a_motion_ends_the_check_and_begins_with_its_end(drawn) -> None:
    drawn.arm.holds_checks = True
    live(drawn, 0.4)
    drawn.do("execute")
    assert drawn.arm.cancelled_checks == 1 and not drawn.arm.goals and drawn.state == "planning"
    drawn.arm.end_check(Outcome.CANCELLED)
    assert len(drawn.arm.goals) == 1 and len(drawn.steps) == 1


def test_a_motion_waits_half_a_second_at_most(drawn) -> None:
    drawn.arm.holds_checks = True
    live(drawn, 0.4)
    drawn.do("execute")
    live(drawn, 0.45)
    assert not drawn.arm.goals
    live(drawn, 0.1)
    assert len(drawn.arm.goals) == 1
    drawn.arm.end_check()
    assert len(drawn.arm.goals) == 1, "once"


def test_a_stop_while_the_motion_waits_holds(drawn) -> None:
    drawn.arm.holds_checks = True
    live(drawn, 0.4)
    drawn.do("execute")
    drawn.do("stop")
    drawn.arm.end_check(Outcome.CANCELLED)
    assert not drawn.arm.goals and drawn.state == "stopped"


@pytest.mark.parametrize("outcome", [Outcome.CANCELLED, Outcome.REJECTED, Outcome.EXECUTION_FAILED])
def test_what_was_not_found_out_is_not_shown(drawn, outcome) -> None:
    drawn.arm.holds_checks = True
    live(drawn, 0.4)
    drawn.arm.end_check(outcome)
    assert drawn.view["plan"] is None and drawn.state == "ready"


def test_nothing_is_asked_of_an_arm_that_is_taken(drawn) -> None:
    drawn.arm.busy = True
    live(drawn, 1.0)
    drawn.arm.busy, drawn.arm.fault_words = False, "the executor is not there"
    live(drawn, 1.0)
    drawn.arm.fault_words = None
    drawn.do("stop")
    live(drawn, 1.0)
    assert not drawn.arm.checks
    drawn.do("resume")
    drawn.see()
    live(drawn, 0.4)
    assert len(drawn.arm.checks) == 1
