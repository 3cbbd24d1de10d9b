"""ROS messages to and from this package's types: pure functions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from control_msgs.msg import JointTolerance
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import PointCloud2
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_core.errors import CoreError
from cliport_core.messages import stamp_to_msg
from cliport_interfaces.action import MoveHand, PickPlace
from cliport_perception.conversions import cloud_points_from_msg
from panda_executor.errors import RequestError
from panda_executor.health import HealthReport
from panda_executor.phase import Phase
from panda_executor.trajectory import JointTrajectory

_NS = 1_000_000_000


def duration_to_msg(seconds: float) -> Duration:
    """Return a duration, rounded to the nearest nanosecond."""
    total = round(seconds * _NS)
    return Duration(sec=total // _NS, nanosec=total % _NS)


def duration_from_msg(message: Duration) -> float:
    """Return the seconds of a duration."""
    return float(message.sec) + float(message.nanosec) / _NS


def trajectory_to_msg(trajectory: JointTrajectory, joint_names: tuple[str, ...]) -> JointTrajectoryMsg:
    """Return a trajectory with the robot's own joint names, in order, and a zero stamp: start now."""
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


def trajectory_goal_to_msg(
    trajectory: JointTrajectory,
    joint_names: tuple[str, ...],
    path_tolerance: float,
    goal_tolerance: float,
    goal_time: float,
) -> FollowJointTrajectory.Goal:
    """Return a goal whose joints may be off their path and their end by so much [rad], the end so late [s]."""
    return FollowJointTrajectory.Goal(
        trajectory=trajectory_to_msg(trajectory, joint_names),
        path_tolerance=[JointTolerance(name=name, position=path_tolerance) for name in joint_names],
        goal_tolerance=[JointTolerance(name=name, position=goal_tolerance) for name in joint_names],
        goal_time_tolerance=duration_to_msg(goal_time),
    )


def trajectory_from_msg(message: JointTrajectoryMsg, joint_names: tuple[str, ...]) -> JointTrajectory:
    """Invert `trajectory_to_msg`; joints may come in any order. Raises ValueError when one is missing."""
    order = [list(message.joint_names).index(name) for name in joint_names]
    positions = np.array([list(point.positions) for point in message.points])[:, order]
    velocities = np.array([list(point.velocities) for point in message.points])[:, order]
    accelerations = np.array([list(point.accelerations) for point in message.points])[:, order]
    times = np.array([duration_from_msg(point.time_from_start) for point in message.points])
    return JointTrajectory(joint_names, times, positions, velocities, accelerations)


def motion_message(result: FollowJointTrajectory.Result) -> str:
    """Return a failed motion's reason in one line."""
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
    """Return a goal by franka_gripper's rule: the commanded position is half of the full width [m]."""
    goal = GripperCommand.Goal()
    goal.command.position = float(width) / 2.0
    goal.command.max_effort = float(max_effort)
    return goal


def feedback_to_msg(phase: Phase, progress: float, plan_id: str = "") -> PickPlace.Feedback:
    """Return feedback with a phase, its name, the progress 0..1, and the plan's id once there is one."""
    return PickPlace.Feedback(phase=int(phase), phase_name=phase.name, progress=float(progress), plan_id=plan_id)


def hand_feedback_to_msg(phase: Phase, progress: float, plan_id: str = "") -> MoveHand.Feedback:
    """Return feedback of a goal of the hand; arguments as those of `feedback_to_msg`."""
    return MoveHand.Feedback(phase=int(phase), phase_name=phase.name, progress=float(progress), plan_id=plan_id)


def cloud_from_raw(raw: bytes, base_frame: str) -> npt.NDArray[np.float32]:
    """Return xyz (N, 3) float32 [m] of a serialized PointCloud2.

    Raises:
        RequestError: when it is in another frame or laid out in another way.
    """
    message: PointCloud2 = deserialize_message(raw, PointCloud2)
    if message.header.frame_id != base_frame:
        raise RequestError(f"the point cloud is in frame '{message.header.frame_id}', expected '{base_frame}'")
    try:
        return cloud_points_from_msg(message)
    except CoreError as error:
        raise RequestError(str(error)) from None


def diagnostics_to_msg(report: HealthReport, stamp_ns: int) -> DiagnosticArray:
    """Return a report as the one status of the executor's arm."""
    status = DiagnosticStatus(
        level=bytes([report.level]), name="panda_executor: arm", message=report.message, hardware_id="arm"
    )
    status.values = [KeyValue(key=key, value=value) for key, value in report.values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message
