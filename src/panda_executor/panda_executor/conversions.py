"""ROS messages <-> this package's types; pure functions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_interfaces.action import PickPlace
from cliport_perception.conversions import (
    cloud_points_from_msg,
    pose_from_msg,
    pose_to_msg,
    stamp_from_msg,
    stamp_to_msg,
)
from cliport_perception.errors import PerceptionError
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome, Primitive
from panda_executor.errors import RequestError
from panda_executor.health import HealthReport
from panda_executor.request import Phase, PickPlaceRequest, PickPlaceResult
from panda_executor.trajectory import PANDA_JOINTS, JointTrajectory

_NS = 1_000_000_000


def duration_to_msg(seconds: float) -> Duration:
    """To the nearest nanosecond."""
    total = round(seconds * _NS)
    return Duration(sec=total // _NS, nanosec=total % _NS)


def duration_from_msg(message: Duration) -> float:
    """[s]."""
    return float(message.sec) + float(message.nanosec) / _NS


def trajectory_to_msg(trajectory: JointTrajectory, joint_names: tuple[str, ...]) -> JointTrajectoryMsg:
    """With the robot's own joint names, in order, and a zero stamp: start now."""
    rows = zip(trajectory.times, trajectory.positions, trajectory.velocities, trajectory.accelerations, strict=True)
    points = [
        JointTrajectoryPoint(
            positions=positions.tolist(),
            velocities=velocities.tolist(),
            accelerations=accelerations.tolist(),
            time_from_start=duration_to_msg(float(time)),
        )
        for time, positions, velocities, accelerations in rows
    ]
    return JointTrajectoryMsg(joint_names=list(joint_names), points=points)


def trajectory_from_msg(message: JointTrajectoryMsg, joint_names: tuple[str, ...]) -> JointTrajectory:
    """The inverse; joints may come in any order. Raises ValueError when one of joint_names is missing."""
    order = [list(message.joint_names).index(name) for name in joint_names]
    rows = [(p.positions, p.velocities, p.accelerations) for p in message.points]
    arrays = [np.array([list(row[i]) for row in rows])[:, order] for i in range(3)]
    times = np.array([duration_from_msg(point.time_from_start) for point in message.points])
    return JointTrajectory(PANDA_JOINTS, times, *arrays)


def motion_message(result: FollowJointTrajectory.Result) -> str:
    """A failed motion's reason in one line."""
    names = {
        FollowJointTrajectory.Result.INVALID_GOAL: "invalid goal",
        FollowJointTrajectory.Result.INVALID_JOINTS: "invalid joints",
        FollowJointTrajectory.Result.OLD_HEADER_TIMESTAMP: "old header timestamp",
        FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED: "path tolerance violated",
        FollowJointTrajectory.Result.GOAL_TOLERANCE_VIOLATED: "goal tolerance violated",
    }
    code = names.get(result.error_code, f"error code {result.error_code}")
    text = " ".join(str(result.error_string).split())
    return f"{code}: {text}" if text and text != code else code


def gripper_goal_to_msg(width: float, max_effort: float) -> GripperCommand.Goal:
    """franka_gripper's rule: the commanded position is half of the full width [m]."""
    goal = GripperCommand.Goal()
    goal.command.position = float(width) / 2.0
    goal.command.max_effort = float(max_effort)
    return goal


def request_from_msg(goal: PickPlace.Goal, base_frame: str) -> PickPlaceRequest:
    """A PickPlace goal.

    Raises:
        RequestError: when the frame, a pose or the primitive cannot be used.
    """
    if goal.header.frame_id not in ("", base_frame):
        raise RequestError(f"poses must be in frame '{base_frame}', got '{goal.header.frame_id}'")
    poses = []
    for name in ("pick", "place"):
        try:
            poses.append(PlanarPose.from_pose(pose_from_msg(getattr(goal, name))))
        except ValueError as error:
            raise RequestError(f"the {name} pose cannot be used: {error}") from None
    try:
        primitive = Primitive(goal.primitive)
    except ValueError:
        known = ", ".join(f"{p.value} ({p.name.lower()})" for p in Primitive)
        raise RequestError(f"unknown primitive {goal.primitive}; known are {known}") from None
    return PickPlaceRequest(poses[0], poses[1], primitive, bool(goal.plan_only))


def request_to_msg(request: PickPlaceRequest, base_frame: str, stamp_ns: int = 0) -> PickPlace.Goal:
    """The inverse of `request_from_msg`."""
    goal = PickPlace.Goal(primitive=int(request.primitive), plan_only=request.plan_only)
    goal.header.frame_id = base_frame
    goal.header.stamp = stamp_to_msg(stamp_ns)
    goal.pick = pose_to_msg(request.pick.as_pose())
    goal.place = pose_to_msg(request.place.as_pose())
    return goal


def goal_stamp(goal: PickPlace.Goal) -> int:
    """Nanoseconds of the observation that a goal comes from, 0 when it does not say."""
    return stamp_from_msg(goal.header.stamp)


def result_to_msg(result: PickPlaceResult) -> PickPlace.Result:
    """A missing centroid becomes the origin."""
    message = PickPlace.Result(outcome=int(result.outcome), message=" ".join(result.message.split()))
    if result.grasp_centroid is not None:
        point = message.grasp_centroid
        point.x, point.y, point.z = (float(v) for v in result.grasp_centroid)
    message.gripper_width = float(result.gripper_width)
    return message


def result_from_msg(message: PickPlace.Result) -> PickPlaceResult:
    """The inverse; the origin becomes no centroid."""
    point = message.grasp_centroid
    centroid = np.array([point.x, point.y, point.z])
    known = centroid if np.any(centroid != 0.0) else None
    return PickPlaceResult(Outcome(message.outcome), message.message, known, message.gripper_width)


def feedback_to_msg(phase: Phase, progress: float) -> PickPlace.Feedback:
    """Phase, its name and the progress 0..1."""
    return PickPlace.Feedback(phase=int(phase), phase_name=phase.name, progress=float(progress))


def cloud_from_raw(raw: bytes, base_frame: str) -> npt.NDArray[np.float32]:
    """xyz (N, 3) float32 [m] of a serialized PointCloud2.

    Raises:
        RequestError: when it is in another frame or laid out in another way.
    """
    message: PointCloud2 = deserialize_message(raw, PointCloud2)
    if message.header.frame_id != base_frame:
        raise RequestError(f"the point cloud is in frame '{message.header.frame_id}', expected '{base_frame}'")
    try:
        return cloud_points_from_msg(message)
    except PerceptionError as error:
        raise RequestError(str(error)) from None


def diagnostics_to_msg(report: HealthReport, stamp_ns: int) -> DiagnosticArray:
    """One status under the name of the executor's arm."""
    status = DiagnosticStatus(
        level=bytes([report.level]), name="panda_executor: arm", message=report.message, hardware_id="arm"
    )
    status.values = [KeyValue(key=key, value=value) for key, value in report.values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message
