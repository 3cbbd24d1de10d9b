"""The motions of a run over an arm that obeys at once: each check, its limit, and when it is made."""

from __future__ import annotations

import numpy as np
import pytest
from commands_bench import PANDA, CommandBench, motion

from cliport_core.outcome import Outcome
from panda_executor.phase import Phase
from panda_executor.ports import MotionResult, MotionStatus, ShouldStop
from panda_executor.run_commands import EarlyEnd, LoadLost
from panda_executor.trajectory import JointTrajectory


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> CommandBench:
    return CommandBench(monkeypatch)


def test_a_motion_is_checked_right_before_it_is_sent(bench: CommandBench) -> None:
    assert not bench.commands.moved
    bench.commands.move(motion())
    steps = ["step", "stop?"] * 3
    assert bench.log == ["stop?", "CARRY", "depart", "validate", "stop?", *steps, "stop?"]
    assert bench.commands.moved
    assert bench.arm.sent[0].velocities[0, 0] == 0.5
    assert bench.gripper.looks == 0, "it carries nothing"


@pytest.mark.parametrize(
    ("look", "sent", "words"),
    [
        (1, 0, "cancelled; the arm holds"),
        (2, 0, "cancelled; the arm holds"),
        (3, 1, "cancelled during carry; the arm holds"),
        (5, 1, "cancelled during carry; the arm holds"),
        (6, 1, "cancelled during carry; the arm holds"),
    ],
)
def test_a_stop_is_looked_for_before_during_and_after(bench: CommandBench, look: int, sent: int, words: str) -> None:
    bench.stop_at(look)
    end = bench.fails()
    assert (end.outcome, str(end), end.may_recover) == (Outcome.CANCELLED, words, False)
    assert len(bench.arm.sent) == sent
    assert bench.commands.moved is bool(sent)


def test_a_motion_that_does_not_hold_any_more_is_not_sent(bench: CommandBench) -> None:
    bench.valid = False
    end = bench.fails()
    assert (end.outcome, end.may_recover) == (Outcome.EXECUTION_FAILED, True)
    assert str(end) == "carry was not sent: it touches a box"
    assert not bench.arm.sent and not bench.commands.moved


@pytest.mark.parametrize("stop", [False, True])
@pytest.mark.parametrize(("message", "why"), [("", ""), ("it sags", ": it sags")])
def test_an_arm_that_is_not_seen_to_rest_is_said(
    bench: CommandBench, stop: bool, message: str, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def execute(trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        bench.stops = lambda: stop
        return MotionResult(MotionStatus.SUCCEEDED, message, standing=False)

    monkeypatch.setattr(bench.arm, "execute", execute)
    end = bench.fails()
    assert end.outcome is (Outcome.CANCELLED if stop else Outcome.EXECUTION_FAILED)
    assert str(end) == f"the arm may still move after carry{why}; look before you go on"
    assert not end.may_recover


@pytest.mark.parametrize(
    ("status", "message", "words", "may_recover"),
    [
        (MotionStatus.ABORTED, "jammed", "the arm's motion aborted during carry: jammed", True),
        (MotionStatus.OFF_GOAL, "", "the arm's motion ended off its goal during carry: no reason given", True),
        (MotionStatus.TIMED_OUT, "late", "the arm's motion timed out during carry: late", True),
        (MotionStatus.UNAVAILABLE, "gone", "the arm's motion unavailable during carry: gone", False),
        (
            MotionStatus.CANCELLED,
            "",
            "the arm's motion cancelled during carry: somebody else cancelled it; look, then call "
            "/panda_executor/recover",
            False,
        ),
        (
            MotionStatus.CANCELLED,
            "by hand",
            "the arm's motion cancelled during carry: somebody else cancelled it; look, then call "
            "/panda_executor/recover (by hand)",
            False,
        ),
    ],
)
def test_a_motion_that_failed_says_why(
    bench: CommandBench, status: MotionStatus, message: str, words: str, may_recover: bool
) -> None:
    bench.arm.fail_at, bench.arm.failure = 0, MotionResult(status, message)
    for off_goal in (False, True):
        bench.arm.sent.clear()
        end = bench.fails(may_end_off=off_goal)
        assert (end.outcome, str(end), end.may_recover) == (Outcome.EXECUTION_FAILED, words, may_recover)


@pytest.mark.parametrize("joint", [0, 3, 6])
@pytest.mark.parametrize(("off", "fine"), [(0.0624, True), (-0.0624, True), (0.0626, False), (-0.0626, False)])
def test_objects_may_push_the_arm_off_by_the_start_tolerance(
    bench: CommandBench, joint: int, off: float, fine: bool
) -> None:
    bench.arm.fail_at, bench.arm.fail_share = 0, 1.0
    bench.arm.failure = MotionResult(MotionStatus.OFF_GOAL, "goal tolerance violated")
    off_goal = np.zeros(7)
    off_goal[joint] = off

    def push(number: int, share: float) -> None:
        bench.arm.positions = PANDA.ready + 0.5 * share + share * off_goal

    bench.arm.on_step = push
    if fine:
        bench.commands.move(motion(), may_end_off=True)
    else:
        assert "ended off its goal" in str(bench.fails(may_end_off=True))
    bench.arm.sent.clear()
    assert "ended off its goal" in str(bench.fails()), "nothing pushes it where it carries nothing along"


@pytest.mark.parametrize("comes_back", [False, True])
def test_a_load_that_is_lost_stops_the_arm(bench: CommandBench, comes_back: bool) -> None:
    def slip(number: int, share: float) -> None:
        bench.gripper.opening = 0.0 if share == 0.5 else 0.04 if comes_back else bench.gripper.opening

    bench.arm.on_step = slip
    with pytest.raises(LoadLost, match="the object was lost during carry"):
        bench.commands.move(motion(), watch_load=True)
    np.testing.assert_array_equal(bench.arm.positions, PANDA.ready)  # the first point of three
    bench.commands.move(motion())  # nobody minds where nothing is carried


@pytest.mark.parametrize(("width", "lost"), [(0.0049, True), (0.005, False), (0.0051, False)])
def test_fingers_closer_than_what_counts_as_missed_hold_nothing(bench: CommandBench, width: float, lost: bool) -> None:
    bench.gripper.opening = width
    assert bench.commands.is_empty() is lost
    bench.arm.on_step = lambda number, share: setattr(bench.gripper, "opening", width if share == 1.0 else 0.04)
    bench.gripper.opening = 0.04
    if lost:
        with pytest.raises(LoadLost):
            bench.commands.move(motion(), watch_load=True)
    else:
        bench.commands.move(motion(), watch_load=True)


@pytest.mark.parametrize("waited", [False, True])
def test_a_stop_while_a_plan_waits_for_its_approval_counts(bench: CommandBench, waited: bool) -> None:
    bench.waited, motions = waited, [motion()]
    assert bench.commands.offer(motions) is waited
    assert bench.plans == [motions] and bench.log == ["plan", "stop?"]
    bench.stop_at(2)
    with pytest.raises(EarlyEnd, match="cancelled; the arm holds"):
        bench.commands.offer(motions)


def test_the_share_done_never_falls_on_the_way_back(bench: CommandBench) -> None:
    commands = bench.commands
    commands.enter(Phase.CARRY)
    commands.progress(Phase.CARRY, 0.5)
    commands.enter(Phase.RECOVERING)
    commands.progress(Phase.RECOVERING, 0.9)
    assert [phase for phase, _ in bench.phases] == [Phase.CARRY] * 2 + [Phase.RECOVERING] * 2
    assert [share for _, share in bench.phases] == pytest.approx([0.6, 0.65, 0.65, 0.65])
    bench.stops = lambda: True
    with pytest.raises(EarlyEnd):
        commands.enter(Phase.LOWER)
    assert len(bench.phases) == 4, "a phase that does not begin is not told"
