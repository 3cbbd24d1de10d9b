from __future__ import annotations

import math

import pytest

from cliport_perception.primitive import Outcome

pytest.importorskip("cliport_interfaces.msg")

from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import PolicyStatus
from cliport_perception.conversions import stamp_from_msg
from cliport_perception.policy_state import PolicyState
from cliport_perception.pose import PlanarPose
from cliport_policy import conversions as c
from cliport_policy.action import PickPlaceAction
from cliport_policy.server.types import Proposal, ServerStatus


@pytest.mark.parametrize("yaw", [-3.1, -0.5, 0.0, 1.57, 3.1])
def test_planar_poses(yaw: float) -> None:
    back = c.planar_pose_from_msg(c.planar_pose_to_msg(PlanarPose(0.4, -0.2, yaw)))
    assert (back.x, back.y, back.yaw) == pytest.approx((0.4, -0.2, yaw))


def test_poses_that_are_no_numbers_are_refused() -> None:
    message = c.planar_pose_to_msg(PlanarPose(0.4, -0.2, 0.0))
    message.position.x = math.nan
    with pytest.raises(ValueError, match="finite"):
        c.planar_pose_from_msg(message)


def test_goal() -> None:
    pick, place = PlanarPose(0.4, -0.2, 0.3), PlanarPose(0.5, 0.1, 1.3)
    action = PickPlaceAction(pick, place, (80, 60), (200, 100), 0.9, 0.8, 0.0)
    goal = c.goal_to_msg(Proposal(action, 12_000_000_034), "put it there", "panda_link0")
    assert (goal.header.frame_id, goal.instruction, goal.plan_only) == ("panda_link0", "put it there", False)
    assert stamp_from_msg(goal.header.stamp) == 12_000_000_034
    assert goal.primitive == PickPlace.Goal.PRIMITIVE_PICK_PLACE
    assert c.planar_pose_from_msg(goal.place).yaw == pytest.approx(1.3)
    stamped = c.pose_stamped_to_msg(pick, "panda_link0", 7)
    assert stamped.pose == goal.pick


def test_status_and_its_constants() -> None:
    message = c.status_to_msg(ServerStatus(PolicyState.FAILED, "why", "what", 3, 0.5), 8, 5)
    assert (message.state, message.message, message.instruction) == (6, "why", "what")
    assert (message.step, message.max_steps, message.confidence) == (3, 8, 0.5)
    for state in PolicyState:
        assert getattr(PolicyStatus, f"STATE_{state.name}") == state


def test_outcomes_match_the_action() -> None:
    for outcome in Outcome:
        assert getattr(PickPlace.Result, f"OUTCOME_{outcome.name}") == outcome
        assert c.outcome_from_msg(PickPlace.Result(outcome=int(outcome))) == outcome
    assert c.outcome_from_msg(PickPlace.Result(outcome=99)) == Outcome.EXECUTION_FAILED
