"""The ends of a run over a planner and commands that are played: outcomes, words, and the way back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from played_run import CONFIG, OPEN, PlayedRun, played_run

from cliport_core.outcome import Outcome, Refusal
from panda_executor.config import AfterFailure
from panda_executor.errors import ExecutorError, GraspError, PlanningError, PortError, RequestError
from panda_executor.run_commands import EarlyEnd


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> PlayedRun:
    return played_run(monkeypatch)


HOME = "move home as RETREAT in scene of home"
BEFORE = ["VALIDATING", "check_poses", "check_cloud first cloud"]


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize(
    ("error", "outcome", "message", "stopped"),
    [
        (RequestError("no cloud"), Outcome.REJECTED, "no cloud", "cancelled; {}: no cloud"),
        (GraspError("flat"), Outcome.PLANNING_FAILED, "flat", "cancelled during planning; {}"),
        (PlanningError("blocked"), Outcome.PLANNING_FAILED, "blocked", "cancelled during planning; {}"),
        (PortError("gone"), Outcome.EXECUTION_FAILED, "gone", None),
    ],
)
def test_each_error_ends_in_an_outcome_of_its_own(
    bench: PlayedRun, error: ExecutorError, outcome: Outcome, message: str, stopped: str | None, moved: bool
) -> None:
    for stops in (False, True):
        bench.moved, bench.stops, bench.clouds = moved, stops, iter(["first cloud"])
        bench.fail = {"check_stop": error}
        result = bench.run()
        if stops and stopped is not None:
            words = stopped.format("the arm holds" if moved else "nothing moved")
            assert (result.outcome, result.message) == (Outcome.CANCELLED, words)
        else:
            assert (result.outcome, result.message) == (outcome, message)


def test_a_refusal_comes_with_its_numbers(bench: PlayedRun) -> None:
    bench.fail = {"check_table first cloud": RequestError("sunk", Refusal.TABLE_HEIGHT, 0.03, 0.01)}
    result = bench.run()
    assert (result.refusal, result.refusal_value, result.refusal_limit) == (Refusal.TABLE_HEIGHT, 0.03, 0.01)
    assert result.gripper_width == 0.02 and result.grasp_centroid is None


def test_a_width_that_nobody_knows_is_not_a_number(bench: PlayedRun) -> None:
    bench.fail = {"check_stop": PortError("gone"), "width": PortError("gone")}
    assert np.isnan(bench.run().gripper_width)


BACK = [
    "RECOVERING", "up from at 1 in grid of first cloud seen at 1 with shape", "move up",
    "home from at 2 in grid of first cloud seen at 1 with shape", "move home as RECOVERING in scene of home",
]  # fmt: skip


def test_what_a_person_asks_for_without_a_goal(bench: PlayedRun) -> None:
    assert bench.make().open().message == "the fingers are open"
    assert bench.log == [f"fingers {OPEN:g} with 7"]
    bench.log.clear()
    result = bench.make().recover()
    assert (result.outcome, result.message) == (Outcome.SUCCEEDED, "the arm went back to its ready pose")
    assert bench.log == BACK
    bench.log.clear()
    bench.up, bench.at, bench.clouds = None, 0, iter(["first cloud"])
    bench.make().recover()
    assert bench.log == [line for line in BACK if line != "move up"]
    bench.log.clear()
    bench.at, bench.clouds = 0, iter(["first cloud"])
    result = bench.make().go_ready()
    assert (result.outcome, result.message) == (Outcome.SUCCEEDED, "the arm is at its ready pose")
    assert bench.log == ["home from at 1 in grid of first cloud seen at 1 with shape", HOME]


@pytest.mark.parametrize("rule", list(AfterFailure))
@pytest.mark.parametrize("may_recover", [False, True])
@pytest.mark.parametrize("at", ["check_stop", "move carry watched"])
def test_the_arm_goes_back_after_a_failure_as_it_was_told(
    bench: PlayedRun, rule: AfterFailure, may_recover: bool, at: str
) -> None:
    bench.config = replace(CONFIG, after_failure=rule)
    bench.fail = {at: EarlyEnd(Outcome.EXECUTION_FAILED, "it jammed", may_recover)}
    result = bench.run()
    back = may_recover and rule is not AfterFailure.STAY and at != "check_stop"
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert result.message == ("it jammed; the arm went back to its ready pose" if back else "it jammed")
    after = bench.log[bench.log.index(at) + 1 :]
    opened = [f"fingers {OPEN:g} with 7"] if rule is AfterFailure.OPEN else []
    wanted = [line.replace("from at 2", "from at 4").replace("from at 1", "from at 3") for line in BACK]
    assert after == ([*opened, *wanted] if back else [])


@pytest.mark.parametrize(
    ("second", "outcome", "words"),
    [
        (EarlyEnd(Outcome.CANCELLED, "stopped"), Outcome.CANCELLED, "the arm did not get back: stopped"),
        (EarlyEnd(Outcome.CANCELLED, "x", True), Outcome.EXECUTION_FAILED, "the arm did not get back: x"),
        (PlanningError("no way"), Outcome.EXECUTION_FAILED, "the arm stays where it is: no way"),
    ],
)
def test_a_way_back_that_fails_is_told_with_what_failed_first(
    bench: PlayedRun, second: Exception, outcome: Outcome, words: str
) -> None:
    bench.config = replace(CONFIG, after_failure=AfterFailure.KEEP)
    bench.fail = {"move carry watched": EarlyEnd(Outcome.EXECUTION_FAILED, "it jammed", True), "move up": second}
    result = bench.run()
    assert (result.outcome, result.message) == (outcome, f"it jammed; {words}")
    assert bench.log[-1] == "move up", "it is tried once"


@pytest.mark.parametrize("may_recover", [False, True])
def test_a_way_out_that_fails_is_told_with_the_miss(bench: PlayedRun, may_recover: bool) -> None:
    bench.config = replace(CONFIG, after_failure=AfterFailure.KEEP)
    bench.empties = [True]
    bench.fail = {HOME: EarlyEnd(Outcome.EXECUTION_FAILED, "it jammed", may_recover)}
    result = bench.run()
    words = "the fingers closed on nothing; it jammed"
    assert result.outcome is (Outcome.GRASP_MISSED if may_recover else Outcome.EXECUTION_FAILED)
    assert result.message == (f"{words}; the arm went back to its ready pose" if may_recover else words)


def test_an_error_of_the_way_out_leaves_the_arm_where_it_is(bench: PlayedRun) -> None:
    bench.config = replace(CONFIG, after_failure=AfterFailure.KEEP)
    bench.empties = [True]
    bench.fail = {"home from at 3 in grid of first cloud seen at 1 with shape": PlanningError("no way")}
    result = bench.run()
    words = "the fingers closed on nothing; the arm stays where it is: no way"
    assert (result.outcome, result.message) == (Outcome.GRASP_MISSED, words)
    assert "RECOVERING" not in bench.log


def test_a_cloud_of_the_wrong_kind_ends_it_before_anything_else_is_asked(bench: PlayedRun) -> None:
    bench.fail = {"check_cloud first cloud": RequestError("empty")}
    bench.run()
    assert bench.log == BEFORE
