"""Every wait of a motion, a proposal, an approval and a recovery, at its limit."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from station_fakes import FakeArm

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from demo_tool.activity import StationHooks
from demo_tool.bulletin import Bulletin
from demo_tool.errors import NotNowError
from demo_tool.home_watch import HomeWatch
from demo_tool.loss_watch import LossWatch
from demo_tool.motion import Motion
from demo_tool.motion_film import MotionFilm
from demo_tool.picture_feed import PictureFeed
from demo_tool.plan_approval import PlanApproval
from demo_tool.ports import ACCEPTED, APPROVAL, OnAnswer, OnEnd, OnPhase
from demo_tool.proposing import Proposals
from demo_tool.recovery import Recovery
from demo_tool.station_config import StationConfig

POSE = PlanarPose(0.4, 0.0, 0.0)
GOAL = ActionGoal(PickPlaceAction(POSE, POSE))
PLAN_ONLY = ActionGoal(PickPlaceAction(POSE, POSE), plan_only=True)


class MuteArm(FakeArm):
    """Keeps what it is asked, and answers when a test does."""

    cancels = 0

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        self.on_phase, self.on_end = on_phase, on_end

    def cancel(self) -> None:
        self.cancels += 1

    def approve(self, plan_id: str, on_answer: OnAnswer) -> None:
        self.answer = on_answer

    def recover(self, on_answer: OnAnswer, on_end: Callable[[], None]) -> None:
        self.answer, self.arrive = on_answer, on_end


class Trip:
    """A motion that begins at 100 s."""

    def __init__(self, goal: ActionGoal = GOAL) -> None:
        self.arm, self.ends, self.changes = MuteArm(), list[ActionResult](), 0
        self.motion = Motion(self.arm, goal, StationConfig(), self._count, self.ends.append)
        self.motion.begin(100.0)

    def _count(self) -> None:
        self.changes += 1

    def outlives(self, now: float) -> None:
        self.motion.tick(now)
        assert self.ends == []

    def ends_at(self, now: float, outcome: Outcome, words: str) -> None:
        self.motion.tick(now)
        assert self.ends == [ActionResult(outcome, words)]
        self.motion.tick(now + 1000.0)
        assert len(self.ends) == 1


def test_an_answer_is_waited_for_for_five_seconds() -> None:
    trip = Trip()
    trip.outlives(105.0)
    trip.ends_at(105.01, Outcome.REJECTED, "the executor gave no answer for 5 s")
    assert trip.arm.cancels == 1 and not trip.motion.moved, "it may still receive it"


def test_the_end_is_waited_for_for_two_minutes_and_that_of_a_cancel_for_five_seconds() -> None:
    trip = Trip()
    trip.arm.on_phase(ACCEPTED, 0.0)
    assert (trip.motion.phase, trip.motion.progress) == ("", 0.0) and trip.changes == 1
    trip.outlives(225.0)
    assert trip.arm.cancels == 0
    trip.outlives(225.01)
    assert trip.arm.cancels == 1
    trip.motion.cancel(229.0)
    assert trip.arm.cancels == 1, "one cancel is enough"
    trip.outlives(230.0)
    trip.ends_at(230.02, Outcome.CANCELLED, "no answer to a cancel for 5 s")
    assert trip.arm.cancels == 2


def test_a_fault_of_a_second_is_a_loss() -> None:
    trip = Trip()
    trip.arm.fault_words = "it is gone"
    trip.outlives(100.0)
    trip.outlives(100.99)
    trip.ends_at(101.0, Outcome.EXECUTION_FAILED, "the arm was lost: it is gone")


def test_faults_that_pass_are_none() -> None:
    watch = LossWatch(1.0)
    faults = [(0.0, "x"), (0.9, "x"), (1.0, None), (1.1, "x"), (2.0, "x"), (2.2, "x")]
    assert [watch.is_lost(fault, now) for now, fault in faults] == [False] * 5 + [True]


@pytest.mark.parametrize(
    ("goal", "phases", "outcome", "moved"),
    [
        (GOAL, (), Outcome.REJECTED, False),
        (GOAL, (ACCEPTED, "VALIDATING", "GRASP_PLANNING", APPROVAL), Outcome.PLANNING_FAILED, False),
        (GOAL, ("GO_ABOVE_PICK",), Outcome.CANCELLED, True),
        (PLAN_ONLY, ("GO_ABOVE_PICK",), Outcome.PLANNED, False),
        (GOAL, (), Outcome.SUCCEEDED, True),
        (GOAL, (), Outcome.GRASP_MISSED, True),
        (GOAL, (), Outcome.DROPPED, True),
        (GOAL, (), Outcome.EXECUTION_FAILED, False),
    ],
)
def test_whether_the_arm_moved(goal: ActionGoal, phases: tuple[str, ...], outcome: Outcome, moved: bool) -> None:
    trip = Trip(goal)
    for phase in phases:
        trip.arm.on_phase(phase, 0.25)
    trip.arm.on_end(ActionResult(outcome, ""))
    trip.arm.on_phase("CARRY", 0.9)
    trip.arm.on_end(ActionResult(Outcome.SUCCEEDED, "twice"))
    assert trip.motion.moved is moved and trip.changes == len(phases)
    assert trip.ends == [ActionResult(outcome, "")] and trip.motion.phase == (phases[-1] if phases else "")


def test_a_plan_waits_until_the_motion_is_cancelled_or_has_ended() -> None:
    trip = Trip()
    trip.arm.on_phase(APPROVAL, 0.2, "1a2b")
    assert trip.motion.waiting_plan == "1a2b"
    trip.arm.on_phase("CARRY", 0.5, "1a2b")
    assert trip.motion.waiting_plan == ""
    trip.arm.on_phase(APPROVAL, 0.2, "3c4d")
    trip.motion.cancel(101.0)
    assert trip.motion.waiting_plan == ""
    other = Trip()
    other.arm.on_phase(APPROVAL, 0.2, "1a2b")
    other.arm.on_end(ActionResult(Outcome.REJECTED, ""))
    assert other.motion.waiting_plan == ""


def test_the_answer_to_an_approval_is_waited_for_for_five_seconds() -> None:
    trip, bulletin = Trip(), Bulletin()
    approval = PlanApproval(trip.arm, bulletin, 5.0, lambda: trip.motion)
    assert approval.shown() is None
    trip.arm.on_phase(APPROVAL, 0.2, "1a2b")
    approval.tick(1000.0)
    approval.approve("1a2b", 200.0)
    with pytest.raises(NotNowError, match="the approval of plan 1a2b is on its way"):
        approval.approve("1a2b", 201.0)
    with pytest.raises(NotNowError, match="the plan that waits is 1a2b, not one without an id: look at it first"):
        approval.approve("", 201.0)
    approval.tick(205.0)
    assert approval.shown() == {"plan": "1a2b", "asked": True, "words": ""}
    approval.tick(205.01)
    words = "the executor gave no answer to the approval: approve once more, or stop"
    assert approval.shown() == {"plan": "1a2b", "asked": False, "words": words}
    assert bulletin.last == {"ok": False, "words": f"plan 1a2b is not approved: {words}"}
    approval.forget()
    assert approval.shown() == {"plan": "1a2b", "asked": False, "words": ""}


class MutePolicy:
    """Keeps what it is asked."""

    def __init__(self) -> None:
        self.heard: list[str] = []

    def ask_require_approval(self, on_answer: Callable[[bool | None], None]) -> None:
        self.answer = on_answer

    def instruct(self, text: str) -> None:
        self.heard.append(text)


def test_the_policy_is_waited_for_for_three_and_for_forty_five_seconds() -> None:
    policy, bulletin = MutePolicy(), Bulletin()
    proposals = Proposals(policy, StationConfig(), bulletin)
    proposals.tick(1e6)
    proposals.cancel("nothing to end")
    before = bulletin.changed
    proposals.begin("put it there", 100.0)
    assert bulletin.changed == before + 1
    proposals.tick(103.0)
    assert proposals.request is not None
    proposals.tick(103.01)
    assert proposals.request is None and policy.heard == []
    policy.answer(True)
    assert policy.heard == [], "that answer comes too late"
    proposals.begin("put it there", 200.0)
    policy.answer(True)
    assert policy.heard == ["put it there"]
    proposals.tick(245.0)
    assert proposals.request is not None
    proposals.tick(245.01)
    assert proposals.request is None and policy.heard == ["put it there", ""]
    words = "the policy's proposal did not come in time: is the policy server running?"
    assert bulletin.last == {"ok": False, "words": words} and bulletin.failure == words


class WayBack:
    """A recovery that begins at 100 s."""

    def __init__(self, home: bool | None = False) -> None:
        self.arm, self.bulletin, self.home, self.rests = MuteArm(), Bulletin(), home, 0
        film = MotionFilm(PictureFeed())
        hooks = StationHooks(lambda: None, self._rest, lambda: False, lambda: self.home, film)
        self.recovery = Recovery(self.arm, StationConfig(), self.bulletin, hooks)
        self.recovery.begin(100.0)

    def _rest(self) -> None:
        self.rests += 1

    def ends(self, last: float, words: str, rests: int) -> None:
        """Check that it goes on at `last` [s], and ends in words a moment later."""
        self.recovery.tick(last)
        assert self.recovery.words != ""
        self.recovery.tick(last + 0.01)
        assert self.recovery.words == "" and self.rests == rests
        assert self.bulletin.failure == f"the arm did not recover: {words}"


def test_a_recovery_is_waited_for_as_long_as_a_motion() -> None:
    WayBack().ends(105.0, "the executor gave no answer for 5 s: look whether the arm moves", 0)
    taken = WayBack()
    taken.arm.answer(True, "")
    assert taken.recovery.words == "begun"
    taken.ends(220.0, "it has not ended for 120 s: look at the arm, STOP stops it", 1)
    stopped = WayBack()
    stopped.arm.answer(True, "it goes")
    assert stopped.recovery.words == "it goes" and stopped.bulletin.last == {"ok": True, "words": "it goes"}
    stopped.recovery.stop(150.0)
    stopped.recovery.stop(153.0)
    stopped.ends(155.0, "no end of it was seen for 5 s after the stop: look at the arm", 1)


@pytest.mark.parametrize(
    ("home", "busy", "begun", "needed"),
    [(False, False, False, True), (False, True, False, False), (False, True, True, True), (True, False, False, False)],
)
def test_when_a_recovery_is_needed(home: bool, busy: bool, begun: bool, needed: bool) -> None:
    back = WayBack(home)
    if not begun:
        back.arm.answer(False, "no")
    back.arm.busy = busy
    assert back.recovery.is_needed is needed


def test_an_arrival_at_home_after_a_stop_is_an_arrival() -> None:
    back = WayBack(True)
    back.arm.answer(True, "")
    back.recovery.stop(101.0)
    back.arm.arrive()
    assert back.bulletin.last == {"ok": True, "words": "the arm is back at its ready pose"}


@pytest.mark.parametrize(("position", "is_home"), [(0.5, True), (-0.5, True), (0.51, False), (-0.51, False)])
def test_each_joint_may_be_off_by_the_tolerance(position: float, is_home: bool) -> None:
    watch = HomeWatch({"a": 0.0, "b": 1.0}, 0.5)
    watch.on_joints({"a": position, "b": 1.0, "finger": 9.0})
    assert watch.is_home is is_home


def test_a_failure_stays_until_something_succeeds_or_begins() -> None:
    bulletin = Bulletin()
    bulletin.fail("it broke")
    bulletin.refuse("not now")
    assert bulletin.failure == "it broke" and bulletin.last == {"ok": False, "words": "not now"}
    assert bulletin.changed == 2
    bulletin.say("done")
    assert bulletin.failure == "" and bulletin.last == {"ok": True, "words": "done"}
    bulletin.fail("again")
    bulletin.clear_failure()
    assert bulletin.failure == "" and bulletin.changed == 4
