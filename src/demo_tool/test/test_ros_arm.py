"""One goal and one stop of the node's arm, without a graph."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from action_msgs.msg import GoalStatus
from rclpy.task import Future
from std_srvs.srv import Trigger

from cliport_core.outcome import ActionResult, Outcome
from cliport_interfaces.action import PickPlace
from demo_tool.ros_arm import _Goal, _SentStop


class Handle:
    """A goal's handle of an action client, whose result comes when a test says so."""

    def __init__(self, accepted: bool = True) -> None:
        self.accepted, self.cancels, self.result = accepted, 0, Future()

    def get_result_async(self) -> Future:
        return self.result

    def cancel_goal_async(self) -> None:
        self.cancels += 1


class Sent:
    """A goal that was sent, and what was heard of it."""

    def __init__(self) -> None:
        self.phases: list[tuple[str, float, str]] = []
        self.ends: list[ActionResult] = []
        self.goal = _Goal(lambda name, progress, plan="": self.phases.append((name, progress, plan)), self.ends.append)


def test_a_goal_that_is_taken_reports_its_phases_and_its_end() -> None:
    sent, handle = Sent(), Handle()
    sent.goal.on_answer(handle)
    sent.goal.on_feedback(PickPlace.Feedback(phase_name="CARRY", progress=0.5, plan_id="1a2b"))
    assert sent.phases == [("ACCEPTED", 0.0, ""), ("CARRY", 0.5, "1a2b")] and handle.cancels == 0
    result = PickPlace.Result(outcome=PickPlace.Result.OUTCOME_SUCCEEDED, message="done", gripper_width=0.25)
    sent.goal._on_result(SimpleNamespace(status=GoalStatus.STATUS_SUCCEEDED, result=result))
    (end,) = sent.ends
    assert (end.outcome, end.message, end.gripper_width) == (Outcome.SUCCEEDED, "done", 0.25)
    sent.goal.cancel()
    assert handle.cancels == 0, "there is nothing to cancel any more"


@pytest.mark.parametrize("handle", [None, Handle(accepted=False)])
def test_a_goal_that_is_not_taken_ends_so(handle: Handle | None) -> None:
    sent = Sent()
    sent.goal.on_answer(handle)
    assert [end.outcome for end in sent.ends] == [Outcome.REJECTED] and sent.phases == []


def test_a_goal_is_cancelled_now_or_once_it_is_taken() -> None:
    early, handle = Sent(), Handle()
    early.goal.cancel()
    early.goal.on_answer(handle)
    assert handle.cancels == 1
    late, other = Sent(), Handle()
    late.goal.on_answer(other)
    assert other.cancels == 0
    late.goal.cancel()
    assert other.cancels == 1


def test_a_goal_without_a_result_has_failed() -> None:
    sent = Sent()
    sent.goal._on_result(None)
    assert sent.ends == [ActionResult(Outcome.EXECUTION_FAILED, "the executor gave no result")]


def answered(success: bool | None) -> Future:
    """Return an answer to a stop; None: an error in its place."""
    future = Future()
    if success is None:
        future.set_exception(RuntimeError("the service is gone"))
    else:
        future.set_result(Trigger.Response(success=success))
    return future


@pytest.mark.parametrize(
    ("answer", "now", "is_open", "is_confirmed"),
    [
        (None, 0.0, False, False),
        (Future(), 9.9, True, False),
        (Future(), 10.0, False, False),
        (answered(True), 0.0, False, True),
        (answered(False), 0.0, False, False),
        (answered(None), 0.0, False, False),
    ],
)
def test_a_stop_is_open_until_its_answer_or_its_deadline(answer, now: float, is_open: bool, is_confirmed: bool) -> None:
    stop = _SentStop(answer, 10.0, lambda words: None)
    assert (stop.is_open(now), stop.is_confirmed()) == (is_open, is_confirmed)
