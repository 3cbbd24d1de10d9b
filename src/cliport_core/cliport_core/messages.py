"""ROS messages to and from this package's types: pure functions."""

from __future__ import annotations

import math
from array import array
from typing import Any

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose as PoseMsg
from geometry_msgs.msg import PoseStamped, Transform
from sensor_msgs.msg import Image

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.errors import GoalError, ImageError
from cliport_core.heightmap import Heightmap
from cliport_core.images import ImageBuffer, decode_color, decode_depth
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import PolicyStatus
from cliport_interfaces.msg import WorkspaceSpec as WorkspaceSpecMsg

_NS = 1_000_000_000
_WITH_ACTION = (PolicyState.WAITING_FOR_APPROVAL, PolicyState.EXECUTING)


def stamp_to_msg(stamp_ns: int) -> Time:
    """Return a stamp [ns] as a message."""
    return Time(sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)


def stamp_from_msg(stamp: Time) -> int:
    """Return the nanoseconds of a stamp."""
    return int(stamp.sec) * _NS + int(stamp.nanosec)


def pose_to_msg(pose: Pose) -> PoseMsg:
    """Return a pose in space as a message."""
    message = PoseMsg()
    message.position.x, message.position.y, message.position.z = (float(v) for v in pose.translation)
    x, y, z, w = (float(v) for v in pose.as_quaternion_xyzw())
    message.orientation.x, message.orientation.y = x, y
    message.orientation.z, message.orientation.w = z, w
    return message


def pose_from_msg(message: PoseMsg) -> Pose:
    """Return the pose of a message. Raises ValueError when a number is not finite or the quaternion is zero."""
    p, q = message.position, message.orientation
    return Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (p.x, p.y, p.z))


def planar_pose_to_msg(pose: PlanarPose) -> PoseMsg:
    """Return a pose on the table (z = 0, yaw about +z) as a message."""
    message = PoseMsg()
    message.position.x, message.position.y = float(pose.x), float(pose.y)
    _, _, message.orientation.z, message.orientation.w = pose.as_quaternion_xyzw()
    return message


def planar_pose_from_msg(message: PoseMsg) -> PlanarPose:
    """Return a pose without its height, roll and pitch. Raises ValueError when a number is not finite."""
    p, q = message.position, message.orientation
    if not math.isfinite(p.z):
        raise ValueError(f"height {p.z} is not finite")
    return PlanarPose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), p.x, p.y)


def pose_to_transform_msg(pose: Pose) -> Transform:
    """Return a pose in space as a transform."""
    as_pose = pose_to_msg(pose)
    message = Transform(rotation=as_pose.orientation)
    message.translation.x = as_pose.position.x
    message.translation.y = as_pose.position.y
    message.translation.z = as_pose.position.z
    return message


def pose_from_transform_msg(message: Transform) -> Pose:
    """Return the pose of a transform. Raises ValueError when a number is not finite or the quaternion is zero."""
    t, q = message.translation, message.rotation
    return Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (t.x, t.y, t.z))


def pose_stamped_to_msg(pose: PlanarPose, frame_id: str, stamp_ns: int) -> PoseStamped:
    """Return a pose on the table of `frame_id`, as it was at `stamp_ns`."""
    message = PoseStamped(pose=planar_pose_to_msg(pose))
    message.header.frame_id = frame_id
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message


def goal_to_msg(goal: ActionGoal, base_frame: str) -> PickPlace.Goal:
    """Return a PickPlace goal; the action's confidence is not in it."""
    action = goal.action
    message = PickPlace.Goal(
        instruction=goal.instruction,
        primitive=int(action.primitive),
        plan_only=bool(goal.plan_only),
        owner=goal.owner,
    )
    message.header.frame_id = base_frame
    message.header.stamp = stamp_to_msg(goal.stamp_ns)
    message.pick = planar_pose_to_msg(action.pick)
    message.place = planar_pose_to_msg(action.place)
    return message


def goal_from_msg(message: PickPlace.Goal, base_frame: str) -> ActionGoal:
    """Invert `goal_to_msg`; a goal without a frame is in the base's.

    Raises:
        GoalError: when the frame, a pose or the primitive cannot be used.
    """
    if message.header.frame_id not in ("", base_frame):
        raise GoalError(f"poses must be in frame '{base_frame}', got '{message.header.frame_id}'")
    poses = []
    for name in ("pick", "place"):
        try:
            poses.append(planar_pose_from_msg(getattr(message, name)))
        except ValueError as error:
            raise GoalError(f"the {name} pose cannot be used: {error}") from None
    try:
        primitive = Primitive(message.primitive)
    except ValueError:
        known = ", ".join(f"{p.value} ({p.label})" for p in Primitive)
        raise GoalError(f"unknown primitive {message.primitive}; known are {known}") from None
    action = PickPlaceAction(poses[0], poses[1], primitive)
    return ActionGoal(
        action,
        str(message.instruction),
        stamp_from_msg(message.header.stamp),
        bool(message.plan_only),
        str(message.owner),
    )


def result_to_msg(result: ActionResult) -> PickPlace.Result:
    """Return a PickPlace result; a missing centroid becomes the origin, and the message one line."""
    message = PickPlace.Result(outcome=int(result.outcome), message=" ".join(result.message.split()))
    if result.grasp_centroid is not None:
        point = message.grasp_centroid
        point.x, point.y, point.z = (float(v) for v in result.grasp_centroid)
    message.gripper_width = float(result.gripper_width)
    message.refusal = int(result.refusal)
    message.refusal_value = math.nan if result.refusal_value is None else float(result.refusal_value)
    message.refusal_limit = math.nan if result.refusal_limit is None else float(result.refusal_limit)
    return message


def result_from_msg(message: PickPlace.Result, ended_well: bool = True) -> ActionResult:
    """Invert `result_to_msg`; the origin becomes no centroid.

    ended_well: the ROS action's status is SUCCEEDED. Without it the result of a success counts as a failed
    execution, because an aborted goal's result may be empty, and so does an outcome that this version does not know.
    """
    outcome = Outcome.from_number(int(message.outcome))
    if outcome.is_success and not ended_well:
        outcome = Outcome.EXECUTION_FAILED
    point = message.grasp_centroid
    centroid = (float(point.x), float(point.y), float(point.z))
    return ActionResult(
        outcome,
        " ".join(str(message.message).split()),
        centroid if any(centroid) else None,
        float(message.gripper_width),
        Refusal.from_number(int(message.refusal)),
        None if math.isnan(message.refusal_value) else float(message.refusal_value),
        None if math.isnan(message.refusal_limit) else float(message.refusal_limit),
    )


def status_to_msg(status: ServerStatus, max_steps: int, stamp_ns: int) -> PolicyStatus:
    """Return the policy server's status as a message; a confidence that is not known is 0."""
    message = PolicyStatus(
        state=int(status.state),
        message=status.message,
        instruction=status.instruction,
        step=status.step,
        max_steps=max_steps,
        confidence=float(status.confidence or 0.0),
        primitive=int(status.primitive),
        proposal_id=status.proposal_id,
    )
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message


def status_from_msg(message: PolicyStatus) -> ServerStatus:
    """Invert `status_to_msg`.

    A state that this version does not know counts as a failure of the server, and so does an action of an unknown
    primitive that waits for approval.
    """
    status = ServerStatus(PolicyState.FAILED, str(message.message), str(message.instruction), int(message.step))
    try:
        status = status._replace(state=PolicyState(message.state))
        if status.state in _WITH_ACTION:
            confidence = float(message.confidence) if 0.0 <= message.confidence <= 1.0 else None
            status = status._replace(confidence=confidence)
            status = status._replace(primitive=Primitive(message.primitive), proposal_id=str(message.proposal_id))
    except ValueError as error:
        if status.state is PolicyState.EXECUTING:  # that the arm moves matters more than how
            return status
        words = f"the policy server is of another version ({error}): build both anew"
        return status._replace(state=PolicyState.FAILED, message=words, confidence=None)
    return status


def workspace_to_msg(workspace: WorkspaceSpec) -> WorkspaceSpecMsg:
    """Return a workspace as a message."""
    return WorkspaceSpecMsg(**workspace.to_dict())


def workspace_from_msg(message: WorkspaceSpecMsg) -> WorkspaceSpec:
    """Return the workspace of a message. Raises WorkspaceError when the numbers make no grid."""
    return WorkspaceSpec.from_dict({name: getattr(message, name) for name in WorkspaceSpec().to_dict()})


def image_to_msg(pixels: npt.NDArray[Any], encoding: str) -> Image:
    """Return an Image of (H, W) or (H, W, C) pixels, little-endian; the header is left to the caller."""
    little = np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("<"))
    data = array("B")
    data.frombytes(memoryview(little).cast("B"))
    message = Image(height=pixels.shape[0], width=pixels.shape[1], encoding=encoding, is_bigendian=0)
    message.step = little.nbytes // pixels.shape[0]
    message.data = data
    return message


def color_from_msg(message: Image) -> npt.NDArray[np.uint8]:
    """Return (H, W, 3) RGB. Raises ImageError, EncodingError."""
    return decode_color(_buffer(message))


def depth_from_msg(message: Image) -> npt.NDArray[np.float32]:
    """Return (H, W) float32 [m], NaN where unknown. Raises ImageError, EncodingError."""
    return decode_depth(_buffer(message))


def _buffer(message: Image) -> ImageBuffer:
    return ImageBuffer(
        memoryview(message.data),
        message.height,
        message.width,
        message.step,
        message.encoding,
        bool(message.is_bigendian),
    )


def heightmap_to_msg(heightmap: Heightmap, frame_id: str) -> HeightmapMsg:
    """Return a heightmap as a message: three images with one header."""
    message = HeightmapMsg(workspace=workspace_to_msg(heightmap.workspace))
    message.header.frame_id = frame_id
    message.header.stamp = stamp_to_msg(heightmap.stamp_ns)
    message.color = image_to_msg(heightmap.color, "rgb8")
    message.height = image_to_msg(heightmap.height, "32FC1")
    message.valid = image_to_msg(heightmap.valid.astype(np.uint8) * np.uint8(255), "mono8")
    for image in (message.color, message.height, message.valid):
        image.header = message.header
    return message


def heightmap_from_msg(message: HeightmapMsg) -> Heightmap:
    """Return the heightmap of a message.

    Raises:
        WorkspaceError: when its numbers make no grid.
        ImageError: when an image has another size or encoding than a heightmap's.
    """
    workspace = workspace_from_msg(message.workspace)
    expected = (("color", "rgb8", "u1", 3), ("height", "32FC1", "<f4", 1), ("valid", "mono8", "u1", 1))
    arrays = []
    for name, encoding, dtype, channels in expected:
        image = getattr(message, name)
        size = workspace.rows * workspace.cols * channels * np.dtype(dtype).itemsize
        fits = (image.height, image.width) == workspace.shape and len(image.data) == size
        if not fits or image.encoding != encoding or image.is_bigendian:
            raise ImageError(
                f"heightmap {name} must be {workspace.shape} {encoding}, "
                f"got {(image.height, image.width)} {image.encoding} in {len(image.data)} bytes"
            )
        arrays.append(np.frombuffer(image.data, dtype=dtype))
    return Heightmap(
        arrays[0].reshape(*workspace.shape, 3),
        arrays[1].astype(np.float32).reshape(workspace.shape),
        arrays[2].reshape(workspace.shape) > 0,
        workspace,
        stamp_from_msg(message.header.stamp),
    )
