"""ROS messages to and from goals of the hand: pure functions."""

from __future__ import annotations

import math

from cliport_core.action import HandGoal
from cliport_core.errors import GoalError
from cliport_core.messages import pose_from_msg, pose_to_msg, result_from_msg, result_to_msg
from cliport_core.outcome import ActionResult
from cliport_interfaces.action import MoveHand, PickPlace

_COMMON = ("outcome", "refusal", "refusal_value", "refusal_limit", "message")  # fields of both actions' results


def hand_goal_to_msg(goal: HandGoal, base_frame: str) -> MoveHand.Goal:
    """Return a MoveHand goal."""
    message = MoveHand.Goal(carried=float(goal.carried), blind=goal.blind, plan_only=goal.plan_only, owner=goal.owner)
    message.header.frame_id = base_frame
    message.target = pose_to_msg(goal.target)
    return message


def hand_goal_from_msg(message: MoveHand.Goal, base_frame: str) -> HandGoal:
    """Invert `hand_goal_to_msg`; a goal without a frame is in the base's.

    Raises:
        GoalError: when the frame, the pose or what is carried cannot be used.
    """
    if message.header.frame_id not in ("", base_frame):
        raise GoalError(f"the target must be in frame '{base_frame}', got '{message.header.frame_id}'")
    try:
        target = pose_from_msg(message.target)
    except ValueError as error:
        raise GoalError(f"the target cannot be used: {error}") from None
    carried = float(message.carried)
    if not math.isfinite(carried) or carried < 0.0:
        raise GoalError(f"carried must be zero or a positive length [m], got {carried}")
    return HandGoal(target, carried, bool(message.blind), bool(message.plan_only), str(message.owner))


def hand_result_to_msg(result: ActionResult) -> MoveHand.Result:
    """Return a MoveHand result, the message one line."""
    whole = result_to_msg(result)
    return MoveHand.Result(**{name: getattr(whole, name) for name in _COMMON})


def hand_result_from_msg(message: MoveHand.Result, ended_well: bool = True) -> ActionResult:
    """Invert `hand_result_to_msg`. ended_well: as of `result_from_msg`."""
    return result_from_msg(PickPlace.Result(**{name: getattr(message, name) for name in _COMMON}), ended_well)
