"""One goal at the executor: every wait to its last moment, signs of life, and answers of goals that are over."""

from __future__ import annotations

import pytest

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_policy.server.goal_tracker import GoalPhase, GoalTracker
from cliport_policy.server.types import Moment, ServerConfig

POSE = PlanarPose(0.4, 0.0, 0.0)
GOAL = ActionGoal(PickPlaceAction(POSE, POSE), "put it there", 0)
SETTINGS = ServerConfig(executor_timeout=5.0, heartbeat_timeout=0.5, goal_timeout=60.0, cancel_timeout=4.0)


class Executor:
    """Notes what it is asked."""

    def __init__(self) -> None:
        self.ready = True
        self.sent: list[int] = []
        self.cancelled: list[int] = []

    def is_ready(self) -> bool:
        return self.ready

    def send(self, token: int, goal: ActionGoal) -> None:
        assert goal is GOAL
        self.sent.append(token)

    def cancel(self, token: int) -> None:
        self.cancelled.append(token)

    def stop(self) -> bool:
        return True

    def resume(self) -> bool:
        return True


def at(wall: float) -> Moment:
    return Moment(wall, 0)


def begun(ready: bool = True, accepted: float | None = None) -> tuple[GoalTracker, Executor]:
    """A goal that was begun at 10 s."""
    executor = Executor()
    executor.ready = ready
    tracker = GoalTracker(SETTINGS, executor)
    tracker.begin(GOAL, at(10.0))
    if accepted is not None:
        assert not tracker.on_response(1, True, at(accepted))
    return tracker, executor


@pytest.mark.parametrize(
    ("ready", "accepted", "last", "said"),
    [
        (False, None, 15.0, "the executor is not there (5.0 s): is it running? (action /panda_executor/pick_place)"),
        (True, None, 15.0, "the executor is not answering (5.0 s): is it running? "),
        (True, 12.0, 72.0, "the executor was not done after 60 s: cancelled"),
    ],
)
def test_a_wait_ends_at_its_last_moment(ready: bool, accepted: float | None, last: float, said: str) -> None:
    tracker, executor = begun(ready, accepted)
    assert tracker.tick(at(last - 0.001)) is None
    found = tracker.tick(at(last))
    assert found is not None and found.startswith(said)
    assert executor.sent == [1] * ready and executor.cancelled == [1] * (accepted is not None)
    assert tracker.phase is (GoalPhase.NONE if accepted is None else GoalPhase.CANCELLING)
    assert tracker.tick(at(last + 1.0)) is None


def test_an_executor_that_comes_late_has_all_its_time_to_answer() -> None:
    tracker, executor = begun(ready=False)
    executor.ready = True
    assert tracker.tick(at(13.0)) is None and executor.sent == [1]
    assert tracker.tick(at(17.9)) is None and executor.sent == [1]
    assert "not answering" in str(tracker.tick(at(18.0)))


def test_a_cancel_has_a_time_of_its_own() -> None:
    tracker, executor = begun(accepted=10.0)
    tracker.cancel(at(20.0))
    tracker.cancel(at(21.0))  # asked for already
    assert executor.cancelled == [1] and tracker.tick(at(23.9)) is None
    assert tracker.tick(at(24.0)) == "executor lost: no answer to a cancel for 4.0 s"
    assert tracker.phase is GoalPhase.NONE


def test_what_was_not_sent_is_not_cancelled() -> None:
    tracker, executor = begun(ready=False)
    tracker.cancel(at(10.5))
    executor.ready = True
    assert tracker.phase is GoalPhase.NONE and tracker.tick(at(11.0)) is None
    assert not executor.sent and not executor.cancelled


def test_silence_is_counted_from_the_last_sign_of_life() -> None:
    tracker, executor = begun()
    tracker.on_heartbeat(at(4.0))  # long ago: the answer is a sign of life, too
    assert not tracker.on_response(1, True, at(10.0))
    assert [tracker.tick(at(10.0 + 0.125 * i)) for i in range(5)] == [None] * 5  # 0.5 s after it
    assert tracker.on_feedback(1, "CARRY", at(10.5))
    assert [tracker.tick(at(10.5 + 0.125 * i)) for i in range(1, 5)] == [None] * 4
    assert tracker.tick(at(11.125)) == "executor lost: no heartbeat for 0.5 s during CARRY"
    assert tracker.phase is GoalPhase.NONE and executor.cancelled == [1]


def test_an_executor_that_never_gave_a_sign_of_life_need_not() -> None:
    tracker, executor = begun(accepted=10.0)
    tracker.on_feedback(1, "CARRY", at(10.1))
    assert tracker.tick(at(60.0)) is None
    executor.ready = False
    assert tracker.tick(at(60.1)) == "executor lost: its action server is gone during CARRY"


@pytest.mark.parametrize(("pause", "lost"), [(0.1875, True), (0.25, False)])
def test_a_pause_of_our_own_does_not_count(pause: float, lost: bool) -> None:
    """Ticks come at 20 Hz; one that is 0.2 s late says that this process stood still."""
    tracker, _ = begun()
    tracker.on_heartbeat(at(10.0))
    tracker.on_response(1, True, at(10.0))
    times = [10.0, 10.125, 10.25, 10.375, 10.5 - 0.0625]
    assert [tracker.tick(at(time)) for time in times] == [None] * 5
    assert (tracker.tick(at(times[-1] + pause)) is not None) == lost
    if not lost:  # the heartbeat counts as if it had come that much later
        assert tracker.tick(at(10.75)) is None
        assert tracker.tick(at(10.8125)) is not None


@pytest.mark.parametrize(
    ("token", "accepted", "cancelled"), [(1, True, [1]), (1, False, []), (2, True, []), (2, False, [])]
)
def test_answers_of_goals_that_are_over(token: int, accepted: bool, cancelled: list[int]) -> None:
    """The first goal was given up without an answer; the second is being executed."""
    tracker, executor = begun()
    tracker.tick(at(15.0))
    tracker.begin(GOAL, at(20.0))
    assert executor.sent == [1, 2] and not tracker.on_response(2, True, at(20.0))
    assert not tracker.on_response(token, accepted, at(20.1))
    assert executor.cancelled == cancelled and tracker.phase is GoalPhase.ACCEPTED
    assert not tracker.on_result(1) and tracker.phase is GoalPhase.ACCEPTED
    assert tracker.on_result(2) and tracker.phase is GoalPhase.NONE
    assert not tracker.on_result(2)


def test_a_refusal_ends_a_goal_also_while_it_is_cancelled() -> None:
    for cancelled in (False, True):
        tracker, executor = begun()
        if cancelled:
            tracker.cancel(at(10.1))
        assert tracker.on_response(1, False, at(10.2)) and tracker.phase is GoalPhase.NONE
        assert executor.cancelled == [1] * cancelled


def test_a_result_may_come_before_the_answer_but_not_before_the_goal() -> None:
    tracker, _ = begun()
    assert tracker.on_result(1)
    waiting, _ = begun(ready=False)
    assert not waiting.on_result(1) and waiting.phase is GoalPhase.WAITING


def test_a_phase_is_news_once_a_goal() -> None:
    tracker, _ = begun()
    assert not tracker.on_feedback(1, "CARRY", at(10.0))  # not accepted yet
    tracker.on_response(1, True, at(10.0))
    assert [tracker.on_feedback(1, "CARRY", at(10.0)) for _ in range(2)] == [True, False]
    assert not tracker.on_feedback(2, "LIFT", at(10.0))
    tracker.on_result(1)
    tracker.begin(GOAL, at(11.0))
    tracker.on_response(2, True, at(11.0))
    assert tracker.on_feedback(2, "CARRY", at(11.0))
