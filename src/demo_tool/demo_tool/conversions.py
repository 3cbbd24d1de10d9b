"""ROS messages <-> this package's types; pure functions."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Pose as PoseMsg
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState
from tf2_msgs.msg import TFMessage

from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import PolicyStatus
from cliport_perception.camera_model import CameraModel
from cliport_perception.conversions import (
    camera_from_msg,
    color_from_msg,
    depth_from_msg,
    heightmap_from_msg,
    pose_from_msg,
    pose_to_msg,
    stamp_to_msg,
)
from cliport_perception.policy_state import PolicyState
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome
from demo_tool.live_view import ColorImage, DepthImage
from demo_tool.ports import ArmResult, PickPlaceGoal

_UNSEEN = 40  # grey of cells that were not seen


def color_from_raw(raw: bytes) -> ColorImage:
    """(H, W, 3) RGB of a serialized Image. Raises ImageError, EncodingError."""
    return color_from_msg(deserialize_message(raw, Image))


def depth_from_raw(raw: bytes) -> DepthImage:
    """(H, W) [m], NaN where unknown, of a serialized Image. Raises ImageError, EncodingError."""
    return depth_from_msg(deserialize_message(raw, Image))


def camera_from_raw(raw: bytes) -> CameraModel:
    """Of a serialized CameraInfo, for images as they come, not rectified. Raises CameraModelError."""
    return camera_from_msg(deserialize_message(raw, CameraInfo))


def joint_names_from_raw(raw: bytes) -> tuple[str, ...]:
    """Of a serialized JointState."""
    message: JointState = deserialize_message(raw, JointState)
    return tuple(message.name)


def transforms_from_raw(raw: bytes) -> TFMessage:
    """A serialized TFMessage."""
    message: TFMessage = deserialize_message(raw, TFMessage)
    return message


def scene_from_raw(raw: bytes) -> ColorImage:
    """The colours of a serialized Heightmap as someone behind the robot sees the table: +x up, +y to the left.

    Raises:
        PerceptionError: when it is no heightmap.
    """
    heightmap = heightmap_from_msg(deserialize_message(raw, HeightmapMsg))
    color = np.where(heightmap.valid[..., None], heightmap.color, np.uint8(_UNSEEN))
    return np.ascontiguousarray(np.swapaxes(color, 0, 1)[::-1, ::-1])


def planar_pose_from_msg(message: PoseMsg) -> PlanarPose:
    """Height, roll and pitch are dropped. Raises ValueError when a number is not finite."""
    return PlanarPose.from_pose(pose_from_msg(message))


def policy_state_from_msg(message: PolicyStatus) -> PolicyState:
    """A state that this version does not know counts as failed."""
    known = {int(state): state for state in PolicyState}
    return known.get(int(message.state), PolicyState.FAILED)


def confidence_from_msg(message: PolicyStatus) -> float | None:
    """How sure the policy is of what waits for approval, 0 to 1; None where nothing waits or it is no such number."""
    waits = policy_state_from_msg(message) is PolicyState.WAITING_FOR_APPROVAL
    return float(message.confidence) if waits and 0.0 <= message.confidence <= 1.0 else None


def goal_to_msg(goal: PickPlaceGoal, base_frame: str) -> PickPlace.Goal:
    """Poses on the table (z = 0)."""
    message = PickPlace.Goal(instruction=goal.instruction, primitive=int(goal.primitive), plan_only=goal.plan_only)
    message.header.frame_id = base_frame
    message.header.stamp = stamp_to_msg(goal.stamp_ns)
    message.pick = pose_to_msg(goal.pick.as_pose())
    message.place = pose_to_msg(goal.place.as_pose())
    return message


def result_from_msg(message: PickPlace.Result, is_ended_well: bool) -> ArmResult:
    """is_ended_well: the goal's status is SUCCEEDED; without it an empty result is a failure.

    The origin is no centroid. An outcome that this version does not know counts as a failed execution.
    """
    known = {int(outcome): outcome for outcome in Outcome}
    outcome = known.get(int(message.outcome), Outcome.EXECUTION_FAILED)
    if outcome in (Outcome.SUCCEEDED, Outcome.PLANNED) and not is_ended_well:
        outcome = Outcome.EXECUTION_FAILED
    point = message.grasp_centroid
    centroid = (float(point.x), float(point.y), float(point.z))
    return ArmResult(
        outcome,
        " ".join(str(message.message).split()),
        centroid if any(centroid) else None,
        float(message.gripper_width),
    )
