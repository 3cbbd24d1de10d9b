"""Goals of the hand and their ends as messages."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("cliport_interfaces.action")

from cliport_core.action import HandGoal
from cliport_core.errors import GoalError
from cliport_core.messages_hand import (
    hand_goal_from_msg,
    hand_goal_to_msg,
    hand_result_from_msg,
    hand_result_to_msg,
)
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import Pose

TARGET = Pose.from_xyz_rpy((0.4, -0.1, 0.5), (3.0, 0.2, -0.4))
GOAL = HandGoal(TARGET, carried=0.16, blind=True, plan_only=True, owner="calibrate")


def test_a_goal_comes_back_as_it_was() -> None:
    found = hand_goal_from_msg(hand_goal_to_msg(GOAL, "base"), "base")
    assert found.target.is_close(TARGET)
    assert (found.carried, found.blind, found.plan_only, found.owner) == (0.16, True, True, "calibrate")
    least = hand_goal_from_msg(hand_goal_to_msg(HandGoal(TARGET), "base"), "base")
    assert (least.carried, least.blind, least.plan_only, least.owner) == (0.0, False, False, "")


def test_a_goal_without_a_frame_is_in_the_bases() -> None:
    assert hand_goal_from_msg(hand_goal_to_msg(GOAL, ""), "base").target.is_close(TARGET)
    with pytest.raises(GoalError, match="the target must be in frame 'base', got 'world'"):
        hand_goal_from_msg(hand_goal_to_msg(GOAL, "world"), "base")


def test_a_pose_that_is_none_is_refused() -> None:
    message = hand_goal_to_msg(GOAL, "base")
    message.target.position.x = math.nan
    with pytest.raises(GoalError, match="the target cannot be used: Pose needs finite values"):
        hand_goal_from_msg(message, "base")


@pytest.mark.parametrize("carried", [-0.01, math.nan, math.inf])
def test_a_length_that_is_none_is_refused(carried: float) -> None:
    message = hand_goal_to_msg(GOAL, "base")
    message.carried = carried
    with pytest.raises(GoalError, match=f"carried must be zero or a positive length.*{carried}"):
        hand_goal_from_msg(message, "base")


def test_an_end_comes_back_as_it_was() -> None:
    end = ActionResult(Outcome.REJECTED, "too far", refusal=Refusal.OUT_OF_REACH, refusal_value=0.3, refusal_limit=0.1)
    assert hand_result_from_msg(hand_result_to_msg(end)) == end
    plain = ActionResult(Outcome.SUCCEEDED, "the hand\nis there")
    assert hand_result_from_msg(hand_result_to_msg(plain)) == ActionResult(Outcome.SUCCEEDED, "the hand is there")


def test_a_goal_that_did_not_end_well_was_no_success() -> None:
    message = hand_result_to_msg(ActionResult(Outcome.SUCCEEDED, ""))
    assert hand_result_from_msg(message, ended_well=False).outcome is Outcome.EXECUTION_FAILED
