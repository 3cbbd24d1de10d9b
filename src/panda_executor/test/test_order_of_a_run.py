"""The order of a run's steps, each with what it is given, over a planner and commands that are played."""

from __future__ import annotations

from dataclasses import replace

import pytest
from played_run import CONFIG, OPEN, PlayedRun, played_run

from cliport_core.action import Primitive
from cliport_core.outcome import ActionResult, Outcome, Refusal
from panda_executor.config import AfterFailure
from panda_executor.errors import GraspError, PlanningError, RequestError
from panda_executor.run_commands import EarlyEnd, LoadLost


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> PlayedRun:
    return played_run(monkeypatch)


BEFORE = ["VALIDATING", "check_poses", "check_cloud first cloud"]
CHECKS = [*BEFORE, "check_empty", "check_table first cloud", "check_positions at 1", "check_reach at 1", "check_stop"]
PLANNED = [*CHECKS, "plan in first cloud from at 1", "offer 7"]
DOWN = ["DESCEND", "fingers 0.05 with 7"]
END = ["OPEN", "let go 0.06", "RETREAT", "move leave", "move retreat", "DONE"]
LOOKED = ["look fine", "find in fine and follow", "judge the pick in fine at at 2"]
LOADED = [
    *PLANNED, "move go_above", *LOOKED, *DOWN, "move descend", "CLOSE", "fingers 0 with 11 on hand of carry",
    "move raise_up", "move carry watched",
]  # fmt: skip
HOME = "move home as RETREAT in scene of home"


def test_an_object_is_picked_and_placed_in_this_order(bench: PlayedRun) -> None:
    result = bench.run()
    assert result == ActionResult(Outcome.SUCCEEDED, "the object was placed", (1.0, 2.0, 3.0), 0.02)
    assert bench.log == [*LOADED, "look fine", "judge the place in fine at at 3", "move lower watched", *END]


def test_a_plan_alone_moves_nothing_and_minds_no_full_hand(bench: PlayedRun) -> None:
    result = bench.run(plan_only=True)
    words = "planned 7 motions of 10.5 s in all; nothing moved"
    assert result == ActionResult(Outcome.PLANNED, words, (1.0, 2.0, 3.0), 0.02)
    assert bench.log == [line for line in PLANNED if line != "check_empty"]
    bench.log.clear()
    bench.clouds = iter(["first cloud"])
    result = bench.run(Primitive.FOLD, plan_only=True)
    assert (result.outcome, result.message) == (Outcome.PLANNED, "planned a fold; nothing moved")
    assert bench.log[-1] == "offer 6" and result.grasp_centroid is None


def test_what_took_a_persons_time_is_checked_in_a_fresh_cloud(bench: PlayedRun) -> None:
    bench.waits, bench.looked = True, ["third cloud", "fine"]
    assert bench.run().grasp_centroid == (7.0, 8.0, 9.0), "of the object where it was found again"
    renewed = ["check_cloud second cloud", "renew in second cloud from at 2", "move new go_above"]
    begun = len(PLANNED)
    looked = ["look third cloud", "find in third cloud", "judge the pick in third cloud at at 3"]
    assert bench.log[begun : begun + 6] == [*renewed, *looked]
    assert "move found lower watched" in bench.log and "judge the place in fine at at 4" in bench.log


def test_an_object_that_moved_is_followed_where_no_person_approved(bench: PlayedRun) -> None:
    bench.looked = ["third cloud"]
    bench.run()
    assert "find in third cloud and follow" in bench.log


def test_a_scene_that_changed_during_the_approval_ends_the_run(bench: PlayedRun) -> None:
    bench.waits = True
    bench.fail = {"renew in second cloud from at 2": PlanningError("a box came")}
    result = bench.run()
    assert result.outcome is Outcome.PLANNING_FAILED
    assert result.message == "the scene changed while the plan waited for its approval: a box came"
    assert not bench.moved


def test_an_object_that_is_gone_sends_the_arm_home(bench: PlayedRun) -> None:
    bench.looked = ["third cloud"]
    bench.fail = {"find in third cloud and follow": GraspError("it was taken away")}
    result = bench.run()
    assert (result.outcome, result.message) == (Outcome.GRASP_MISSED, "while the arm was under way it was taken away")
    home = "home from at 2 in grid of first cloud seen at 1 raised by third cloud at at 2 with shape"
    assert bench.log[-4:] == ["RETREAT", f"fingers {OPEN:g} with 7", home, HOME]


@pytest.mark.parametrize("primitive", list(Primitive))
def test_nothing_is_gone_down_to_where_something_came(bench: PlayedRun, primitive: Primitive) -> None:
    bench.looked = ["a box"]
    result = bench.run(primitive)
    assert (result.outcome, result.message) == (Outcome.GRASP_MISSED, "while the arm was under way a box came")
    home = "home from at 3 in grid of first cloud seen at 1 raised by a box at at 3 with shape"
    judged = f"judge the {'pick' if primitive is Primitive.PICK_PLACE else 'drag'} in a box at at 2"
    assert bench.log[-5:] == [judged, "RETREAT", f"fingers {OPEN:g} with 7", home, HOME]


UNSEEN = RequestError("it is frozen", Refusal.OLD_CLOUD, 3.0, 0.0)


@pytest.mark.parametrize("rule", [AfterFailure.STAY, AfterFailure.KEEP])
@pytest.mark.parametrize(
    ("primitive", "looks"), [*((primitive, 0) for primitive in Primitive), (Primitive.PICK_PLACE, 1)]
)
def test_the_hand_does_not_go_down_blindly(
    bench: PlayedRun, primitive: Primitive, looks: int, rule: AfterFailure
) -> None:
    """Neither to an object nor, with it, to its place."""
    bench.looked, bench.config = [*["fine"] * looks, UNSEEN], replace(CONFIG, after_failure=rule)
    result = bench.run(primitive)
    words = "the scene could not be looked at again before the hand goes down: it is frozen"
    back = rule is AfterFailure.KEEP
    assert result.message == (f"{words}; the arm went back to its ready pose" if back else words)
    assert (result.outcome, result.refusal) == (Outcome.EXECUTION_FAILED, Refusal.OLD_CLOUD)
    assert (result.refusal_value, result.refusal_limit) == (3.0, 0.0)
    after = bench.log[bench.log.index("look it is frozen") + 1 :]
    home = ["move up", "move home as RECOVERING in scene of home"]
    assert [line for line in after if line.startswith(("move", "fingers", "let go"))] == (home if back else [])


def test_a_stop_ends_the_wait_for_a_last_look(bench: PlayedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    def look() -> None:
        bench.fail = {"check_stop": EarlyEnd(Outcome.CANCELLED, "cancelled; the arm holds")}
        raise UNSEEN

    monkeypatch.setattr(bench, "look", look)
    result = bench.run()
    assert (result.outcome, result.message) == (Outcome.CANCELLED, "cancelled; the arm holds")
    assert result.refusal is Refusal.NONE and bench.log[-2:] == ["move go_above", "check_stop"]


def test_a_place_that_changed_keeps_what_is_held(bench: PlayedRun) -> None:
    bench.looked = ["fine", "a box"]
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert result.message == ("the place changed while the arm was under way: a box came; what is held stays held")
    assert bench.log[-1] == "judge the place in a box at at 3"


def test_the_way_back_avoids_what_came(bench: PlayedRun) -> None:
    bench.looked, bench.config = ["fine", "a box"], replace(CONFIG, after_failure=AfterFailure.KEEP)
    assert bench.run().outcome is Outcome.EXECUTION_FAILED
    grid = "grid of first cloud seen at 1 raised by a box at at 4"
    ways = [line for line in bench.log if line.startswith(("up from", "home from"))]
    assert ways == [f"up from at 4 in {grid} with shape", f"home from at 5 in {grid} with shape"]


def test_fingers_that_closed_on_nothing_open_go_up_and_home(bench: PlayedRun) -> None:
    bench.empties = [True]
    result = bench.run()
    assert (result.outcome, result.message) == (Outcome.GRASP_MISSED, "the fingers closed on nothing")
    escape = "move raise_up as RETREAT in scene of descend"
    assert bench.log[-5:-2] == ["RETREAT", "fingers 0.05 with 7", escape] and bench.log[-1] == HOME


def test_what_slipped_out_while_it_was_raised_is_a_miss(bench: PlayedRun) -> None:
    bench.empties = [False, True]
    result = bench.run()
    assert (result.outcome, result.message) == (
        Outcome.GRASP_MISSED, "the object slipped out while it was raised"
    )  # fmt: skip
    assert bench.log[-4:-2] == ["RETREAT", f"fingers {OPEN:g} with 7"] and bench.log[-5] == "move raise_up"


@pytest.mark.parametrize("name", ["carry", "lower"])
def test_what_is_lost_on_the_way_is_dropped(bench: PlayedRun, name: str) -> None:
    bench.fail = {f"move {name} watched": LoadLost("lost")}
    result = bench.run()
    assert (result.outcome, result.message) == (Outcome.DROPPED, "lost")
    assert bench.log[-4:-2] == ["RETREAT", f"fingers {OPEN:g} with 7"] and bench.log[-1] == HOME


@pytest.mark.parametrize("lift", [False, True])
@pytest.mark.parametrize("waits", [False, True])
def test_a_sweep_goes_down_along_and_up(bench: PlayedRun, waits: bool, lift: bool) -> None:
    bench.lift, bench.waits = lift, waits
    result = bench.run(Primitive.SWEEP)
    assert (result.outcome, result.message) == (Outcome.SUCCEEDED, "the sweep was carried out")
    new = "new " if waits else ""
    offered = ["GRASP_PLANNING", "plan drag in first cloud from at 1", f"offer {6 if lift else 5}"]
    renewed = ["check_cloud second cloud", "renew drag in second cloud from at 2"] if waits else []
    lifted = [f"move {new}lift maybe off"] if lift else []
    assert bench.log == [
        *CHECKS, *offered, *renewed, f"move {new}go_above",
        "look fine", f"judge the drag in fine at at {3 if waits else 2}", "DESCEND", "fingers 0.03 with 7",
        f"move {new}descend maybe off", *lifted, f"move {new}drag maybe off", f"move {new}leave",
        f"move {new}retreat", "DONE",
    ]  # fmt: skip


def test_a_fold_holds_on_to_what_it_moves(bench: PlayedRun) -> None:
    result = bench.run(Primitive.FOLD)
    assert (result.outcome, result.message) == (Outcome.SUCCEEDED, "the fold was carried out")
    assert bench.log[len(CHECKS) + 3 :] == [
        "move go_above", "look fine", "judge the drag in fine at at 2", "DESCEND", "fingers 0.03 with 7",
        "move descend maybe off", "CLOSE", "fingers 0 with 11",
        "move lift maybe off", "move drag watched maybe off", "OPEN", "let go 0.03", "move leave", "move retreat",
        "DONE",
    ]  # fmt: skip


def test_a_fold_that_holds_nothing_goes_straight_up(bench: PlayedRun) -> None:
    bench.empties = [True]
    assert bench.run(Primitive.FOLD).message == "the fingers closed on nothing"
    assert bench.log[-5:-2] == ["RETREAT", "fingers 0.03 with 7", "move escape"]


def test_a_fold_that_loses_what_it_moves_says_so(bench: PlayedRun) -> None:
    bench.fail = {"move drag watched maybe off": LoadLost("lost")}
    assert bench.run(Primitive.FOLD).outcome is Outcome.DROPPED
