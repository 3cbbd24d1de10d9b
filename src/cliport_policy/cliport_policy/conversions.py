"""The policy server's types -> ROS messages; pure functions."""

from __future__ import annotations

from geometry_msgs.msg import Pose as PoseMsg
from geometry_msgs.msg import PoseStamped

from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import PolicyStatus
from cliport_perception.conversions import pose_from_msg, pose_to_msg, stamp_to_msg
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome
from cliport_policy.server.types import Proposal, ServerStatus


def planar_pose_to_msg(pose: PlanarPose) -> PoseMsg:
    """On the table (z = 0), yaw about +z."""
    return pose_to_msg(pose.as_pose())


def planar_pose_from_msg(message: PoseMsg) -> PlanarPose:
    """The inverse; height, roll and pitch are dropped. Raises ValueError when a number is not finite."""
    return PlanarPose.from_pose(pose_from_msg(message))


def pose_stamped_to_msg(pose: PlanarPose, frame_id: str, stamp_ns: int) -> PoseStamped:
    message = PoseStamped(pose=planar_pose_to_msg(pose))
    message.header.frame_id = frame_id
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message


def status_to_msg(status: ServerStatus, max_steps: int, stamp_ns: int) -> PolicyStatus:
    message = PolicyStatus(
        state=int(status.state),
        message=status.message,
        instruction=status.instruction,
        step=status.step,
        max_steps=max_steps,
        confidence=status.confidence,
    )
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message


def goal_to_msg(proposal: Proposal, instruction: str, frame_id: str) -> PickPlace.Goal:
    goal = PickPlace.Goal(instruction=instruction, primitive=PickPlace.Goal.PRIMITIVE_PICK_PLACE)
    goal.header.frame_id = frame_id
    goal.header.stamp = stamp_to_msg(proposal.stamp_ns)
    goal.pick = planar_pose_to_msg(proposal.action.pick)
    goal.place = planar_pose_to_msg(proposal.action.place)
    return goal


def outcome_from_msg(result: PickPlace.Result) -> Outcome:
    """An outcome that this version does not know counts as a failed execution."""
    try:
        return Outcome(result.outcome)
    except ValueError:
        return Outcome.EXECUTION_FAILED
