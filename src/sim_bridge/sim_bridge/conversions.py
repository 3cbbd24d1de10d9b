"""Messages made from plain values, and back: pure functions, nothing else."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Duration as DurationMsg
from builtin_interfaces.msg import Time as TimeMsg
from control_msgs.action import FollowJointTrajectory
from control_msgs.action import GripperCommand as GripperCommandAction
from control_msgs.msg import JointTolerance as JointToleranceMsg
from franka_msgs.action import Grasp, Move
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, Image, JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_core import Pose
from cliport_perception import CameraModel
from sim_bridge.control.gripper_controller import GripperGoal, GripperResult, HandTask
from sim_bridge.control.joint_trajectory_controller import TrajectoryExecution, TrajectoryFeedback
from sim_bridge.control.trajectory_goal import (
    ErrorCode,
    GoalRejectedError,
    JointTolerance,
    TrajectoryGoal,
    TrajectoryPoint,
)

_IMAGE_TYPES = {"rgb8": (np.uint8, 3), "32FC1": (np.float32, 1)}


def time_to_msg(seconds: float) -> TimeMsg:
    """Return the stamp of a time [s], zero or later."""
    whole, nanoseconds = divmod(round(seconds * 1e9), 1_000_000_000)
    return TimeMsg(sec=whole, nanosec=nanoseconds)


def time_from_msg(msg: TimeMsg | DurationMsg) -> float:
    """Return a stamp or a duration in seconds."""
    return msg.sec + msg.nanosec * 1e-9


def image_to_msg(pixels: npt.NDArray[np.generic], encoding: str, frame_id: str, time: float) -> Image:
    """Return the message of pixels: (H, W, 3) uint8 as rgb8, or (H, W) float32 as 32FC1."""
    kind, channels = _IMAGE_TYPES[encoding]
    height, width = pixels.shape[:2]
    if pixels.dtype != kind or pixels.size != height * width * channels:
        raise ValueError(
            f"{encoding} needs {np.dtype(kind)} with {channels} channels, got {pixels.dtype} {pixels.shape}"
        )
    msg = Image(height=height, width=width, encoding=encoding, is_bigendian=0)
    msg.header.frame_id = frame_id
    msg.header.stamp = time_to_msg(time)
    msg.step = width * channels * pixels.dtype.itemsize
    data = array("B")  # rclpy takes an array as it is; anything else it checks byte by byte
    data.frombytes(memoryview(np.ascontiguousarray(pixels)).cast("B"))
    msg.data = data
    return msg


def image_from_msg(msg: Image) -> npt.NDArray[np.generic]:
    """Return the pixels of an rgb8 image, (H, W, 3) uint8, or of a 32FC1 image, (H, W) float32."""
    kind, channels = _IMAGE_TYPES[msg.encoding]
    shape = (msg.height, msg.width, 3) if channels == 3 else (msg.height, msg.width)
    return np.frombuffer(msg.data, dtype=kind).reshape(shape)


def camera_info_to_msg(camera: CameraModel, frame_id: str, time: float) -> CameraInfo:
    """Return the CameraInfo of an unrectified monocular camera."""
    msg = CameraInfo(height=camera.height, width=camera.width, distortion_model=camera.distortion_model)
    msg.header.frame_id = frame_id
    msg.header.stamp = time_to_msg(time)
    msg.d = [float(value) for value in camera.distortion] or [0.0] * 5
    msg.k = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    msg.r = np.eye(3).ravel().tolist()
    msg.p = [camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return msg


def transform_to_msg(child_in_parent: Pose, parent: str, child: str, time: float) -> TransformStamped:
    """Return the stamped transform with the pose of frame `child` in frame `parent`."""
    msg = TransformStamped(child_frame_id=child)
    msg.header.frame_id = parent
    msg.header.stamp = time_to_msg(time)
    translation, rotation = msg.transform.translation, msg.transform.rotation
    translation.x, translation.y, translation.z = map(float, child_in_parent.translation)
    rotation.x, rotation.y, rotation.z, rotation.w = map(float, child_in_parent.as_quaternion_xyzw())
    return msg


def joint_state_to_msg(
    names: Sequence[str],
    positions: npt.ArrayLike,
    velocities: npt.ArrayLike,
    efforts: npt.ArrayLike,
    time: float,
) -> JointState:
    """Return a JointState with as many positions [rad, m], velocities and efforts [N m] as names."""
    msg = JointState(name=list(names))
    msg.header.stamp = time_to_msg(time)
    msg.position, msg.velocity, msg.effort = (
        array("d", np.asarray(values, dtype=np.float64).tolist()) for values in (positions, velocities, efforts)
    )
    return msg


def trajectory_goal_from_msg(msg: FollowJointTrajectory.Goal) -> TrajectoryGoal:
    """Return the goal of the arm's controller; raises GoalRejectedError for what a joint controller cannot follow."""
    if msg.multi_dof_trajectory.points or msg.component_path_tolerance or msg.component_goal_tolerance:
        raise GoalRejectedError(ErrorCode.INVALID_GOAL, "multi-DOF trajectories are not supported by this controller")
    stamp = time_from_msg(msg.trajectory.header.stamp)
    return TrajectoryGoal(
        joint_names=tuple(msg.trajectory.joint_names),
        points=tuple(
            TrajectoryPoint(
                time_from_msg(point.time_from_start),
                tuple(point.positions),
                tuple(point.velocities),
                tuple(point.accelerations),
            )
            for point in msg.trajectory.points
        ),
        start_time=None if stamp == 0.0 else stamp,
        path_tolerance=_tolerances_from_msg(msg.path_tolerance),
        goal_tolerance=_tolerances_from_msg(msg.goal_tolerance),
        goal_time_tolerance=time_from_msg(msg.goal_time_tolerance),
    )


def trajectory_feedback_to_msg(
    feedback: TrajectoryFeedback, joint_names: Sequence[str]
) -> FollowJointTrajectory.Feedback:
    """Return desired, actual and error (desired - actual) of each joint."""
    msg = FollowJointTrajectory.Feedback(joint_names=list(joint_names))
    msg.header.stamp = time_to_msg(feedback.time)
    desired = feedback.desired
    msg.desired = _point_to_msg(desired.positions, desired.velocities, desired.accelerations)
    msg.actual = _point_to_msg(feedback.positions, feedback.velocities)
    msg.error = _point_to_msg(desired.positions - feedback.positions, desired.velocities - feedback.velocities)
    return msg


def trajectory_result_to_msg(execution: TrajectoryExecution) -> FollowJointTrajectory.Result:
    """Return error code and text of a goal that has ended."""
    return FollowJointTrajectory.Result(error_code=int(execution.error_code), error_string=execution.error_string)


def gripper_goal_from_msg(msg: GripperCommandAction.Goal) -> GripperGoal:
    """Return the goal of the hand's controller: half a width."""
    return GripperGoal(msg.command.position, msg.command.max_effort)


def grasp_goal_from_msg(msg: Grasp.Goal) -> GripperGoal:
    """Return the goal of the hand's controller from a grasp's full width."""
    epsilon = (msg.epsilon.inner, msg.epsilon.outer)
    return GripperGoal(msg.width / 2.0, msg.force, HandTask.GRASP, msg.speed, epsilon)


def move_goal_from_msg(msg: Move.Goal) -> GripperGoal:
    """Return the goal of the hand's controller from a full width."""
    return GripperGoal(msg.width / 2.0, task=HandTask.MOVE, speed=msg.speed)


def gripper_result_to_msg(result: GripperResult) -> GripperCommandAction.Result:
    """Return the hand's result; its position is the full width."""
    return GripperCommandAction.Result(
        position=result.width, effort=result.effort, stalled=result.stalled, reached_goal=result.reached_goal
    )


def gripper_feedback_to_msg(result: GripperResult) -> GripperCommandAction.Feedback:
    """Return the hand's feedback; its position is the full width."""
    return GripperCommandAction.Feedback(
        position=result.width, effort=result.effort, stalled=result.stalled, reached_goal=result.reached_goal
    )


def _tolerances_from_msg(tolerances: Sequence[JointToleranceMsg]) -> dict[str, JointTolerance]:
    return {tolerance.name: JointTolerance(tolerance.position, tolerance.velocity) for tolerance in tolerances}


def _point_to_msg(*columns: npt.NDArray[np.float64]) -> JointTrajectoryPoint:
    msg = JointTrajectoryPoint()
    for name, values in zip(("positions", "velocities", "accelerations"), columns, strict=False):
        setattr(msg, name, array("d", values.tolist()))
    return msg
