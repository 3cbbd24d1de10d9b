"""The way back to the ready pose after a stop or a failure: offered, asked for, stopped, and its end said."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from station_fakes import FakeArm

from cliport_core.outcome import ActionResult, Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from demo_tool.home_watch import HomeWatch
from demo_tool.ports import OnAnswer
from demo_tool.station_config import StationConfig

HOME = StationConfig().home
AWAY = {**HOME, "panda_joint4": -1.5}
BEGUN = "begun; the log says how it ends"


class StrandedArm(FakeArm):
    """Recovers only as a test says."""

    def recover(self, on_answer: OnAnswer, on_end: Callable[[], None]) -> None:
        self.recoveries += 1
        self.answer, self.arrive = on_answer, on_end


@pytest.fixture
def away(make_bench):
    """A bench whose arm stands away from its ready pose."""
    bench = make_bench(StrandedArm())
    bench.begin()
    bench.station.on_joints(AWAY)
    return bench


def test_it_is_offered_where_the_arm_is_measured_away(bench) -> None:
    bench.see()
    assert not bench.view["away"], "nothing was measured"
    bench.station.on_joints(HOME)
    assert not bench.view["away"]
    before = bench.station.changed
    bench.station.on_joints(AWAY)
    assert bench.view["away"] and bench.station.changed > before
    bench.station.on_joints(AWAY)
    assert bench.station.changed == before + 1
    bench.arm.busy = True
    assert not bench.view["away"], "somebody else moves it"
    bench.arm.busy = False
    bench.station.on_policy_status(ServerStatus(PolicyState.EXECUTING, "step 1: CARRY", "something else"))
    assert not bench.view["away"]
    assert "the policy server is moving the arm" in bench.refused("recover")


def test_an_arm_that_is_taken_while_it_is_asked_for_does_not_recover(away, monkeypatch) -> None:
    def taken() -> None:
        away.station.on_policy_status(ServerStatus(PolicyState.EXECUTING, "step 1: CARRY", "something else"))

    monkeypatch.setattr(away.arm, "fault", taken)
    assert "the policy server is moving the arm" in away.refused("recover")
    assert away.arm.recoveries == 0


@pytest.mark.parametrize(
    ("positions", "is_home"),
    [
        (HOME, True),
        ({**HOME, "panda_finger_joint1": 0.04}, True),
        ({**HOME, "panda_joint1": 0.04}, True),
        ({**HOME, "panda_joint1": -0.06}, False),
        ({**HOME, "panda_joint1": float("nan")}, None),
        ({"panda_joint1": 0.5}, None),
        ({}, None),
    ],
)
def test_home_is_measured(positions: dict[str, float], is_home: bool | None) -> None:
    watch = HomeWatch(HOME, 0.05)
    watch.on_joints(positions)
    assert watch.is_home is is_home
    watch.forget()
    assert watch.is_home is None


def test_a_recovery_succeeds(away) -> None:
    away.do("recover")
    assert away.state == "recovering" and away.view["words"] == "Recovering: asking the arm."
    away.arm.answer(True, BEGUN)
    assert away.view["words"] == f"Recovering: {BEGUN}." and away.view["last"] == {"ok": True, "words": BEGUN}
    away.station.on_joints(HOME)
    away.arm.arrive()
    assert away.view["last"] == {"ok": True, "words": "the arm is back at its ready pose"}
    assert "before the arm came to rest" in away.view["words"], "older pictures show the arm on its way"
    away.rest()
    away.station.on_joints(HOME)
    assert away.state == "ready" and not away.view["away"] and away.arm.recoveries == 1


def test_a_recovery_is_refused_in_the_executors_words(away) -> None:
    away.do("recover")
    words = "where the camera stands is not known: no camera_info has arrived; is it running?"
    away.arm.answer(False, words)
    assert away.state == "failed" and away.last == f"the arm did not recover: {words}" and away.view["away"]
    away.arm.arrive()
    assert away.state == "failed"
    away.do("recover")  # it can be tried again
    assert away.state == "recovering" and away.arm.recoveries == 2


@pytest.mark.parametrize(
    ("measured", "words"), [(AWAY, "ended elsewhere; the executor's log says why"), ({}, "no joint states say where")]
)
def test_a_recovery_that_does_not_arrive_says_so(away, measured, words) -> None:
    away.do("recover")
    away.arm.answer(True, BEGUN)
    away.station.on_joints(measured)
    away.arm.arrive()
    away.rest()
    assert away.state == "failed" and words in away.last


def test_nothing_else_begins_while_the_arm_goes_back(away) -> None:
    away.draw()
    away.do("recover")
    for command in ("recover", "execute", "preview", "record", "propose"):
        assert "busy recovering" in away.refused(command)
    assert away.arm.recoveries == 1 and away.view["away"]


def test_it_is_refused_while_another_motion_runs(held) -> None:
    held.begin()
    held.draw()
    held.do("execute")
    assert "busy planning" in held.refused("recover")
    held.arm.on_phase("CARRY", 0.6)
    assert "busy executing" in held.refused("recover")
    held.arm.on_end(ActionResult(Outcome.EXECUTION_FAILED, "somebody else cancelled it"))
    held.station.on_joints(AWAY)
    held.rest()
    assert held.state == "failed" and held.view["away"]
    held.do("recover")
    assert held.arm.recoveries == 1


def test_stop_works_on_the_way_back_and_comes_first(away) -> None:
    away.do("stop")
    assert "resume first" in away.refused("recover") and away.view["away"]
    away.do("resume")
    away.do("recover")
    away.arm.answer(True, BEGUN)
    away.do("stop")
    assert away.arm.stops == 2 and away.state == "stopped" and "still recovering" in away.view["words"]
    away.arm.arrive()
    assert away.state == "stopped" and away.last == "the arm did not recover: stopped on the way; the arm holds"
    away.do("resume")
    away.station.on_joints(AWAY)
    assert away.view["away"]


@pytest.mark.parametrize(
    ("answered", "seconds", "words"),
    [
        (False, 5.1, "the executor gave no answer for 5 s"),
        (True, 120.1, "it has not ended for 120 s"),
    ],
)
def test_every_wait_ends(away, answered, seconds, words) -> None:
    away.do("recover")
    if answered:
        away.arm.answer(True, BEGUN)
    away.wait(seconds - 0.2)
    assert away.state == "recovering"
    away.wait(0.2)
    away.rest()
    assert away.state == "failed" and words in away.last
    away.arm.arrive()
    assert words in away.last


def test_a_stop_without_an_end_and_a_lost_arm_are_said(away) -> None:
    away.do("recover")
    away.arm.answer(True, BEGUN)
    away.do("stop")
    away.wait(5.1)
    assert "no end of it was seen for 5 s after the stop" in away.last
    away.do("resume")
    away.rest()
    away.do("recover")
    away.arm.fault_words = "the executor gives no sign of life for 1 s"
    away.wait(0.1)
    away.wait(1.1)
    assert "the arm was lost: the executor gives no sign of life" in away.last
    assert away.refused("recover") == away.arm.fault_words


def test_who_closes_the_station_stops_the_way_back(away) -> None:
    away.do("recover")
    away.arm.answer(True, BEGUN)
    stop = away.arm.stop

    def halt(reason, on_failure) -> None:
        stop(reason, on_failure)
        away.arm.arrive()

    away.arm.stop = halt
    away.station.close()
    assert away.arm.stops == 1 and "stopped on the way" in away.last


def test_what_the_hand_still_holds_is_told_while_the_arm_does_nothing(away) -> None:
    assert away.view["held_width"] is None
    away.arm.held = 0.04
    assert away.view["held_width"] == 0.04
    away.arm.busy = True
    assert away.view["held_width"] is None, "it is on its way with it"


def test_the_hand_opens(away) -> None:
    away.arm.held = 0.04
    away.do("open_hand")
    assert away.view["held_width"] is None and away.view["last"] == {"ok": True, "words": "the hand opens"}
    assert away.state != "failed"


def test_a_hand_that_does_not_open_is_said_in_the_executors_words(away) -> None:
    away.arm.held, away.arm.opening_refusal = 0.04, "another goal is being executed"
    away.do("open_hand")
    assert away.state == "failed" and away.last == "the hand did not open: another goal is being executed"
    assert away.view["held_width"] == 0.04


def test_a_stopped_or_busy_hand_is_not_opened(away, held) -> None:
    away.do("stop")
    assert "resume first" in away.refused("open_hand")
    held.begin()
    held.draw()
    held.do("execute")
    assert "busy planning" in held.refused("open_hand")
    assert away.arm.openings == held.arm.openings == 0
