"""Values to messages and back."""

# ruff: noqa: E402
import time

import numpy as np
import pytest

for package in ("rclpy", "control_msgs"):
    pytest.importorskip(package, exc_type=ImportError)

from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from control_msgs.msg import JointTolerance as JointToleranceMsg
from trajectory_msgs.msg import JointTrajectoryPoint, MultiDOFJointTrajectoryPoint

from cliport_core import Pose
from cliport_perception import CameraModel
from sim_bridge import conversions
from sim_bridge.control import (
    GoalRejectedError,
    GripperResult,
    JointCommand,
    JointTolerance,
    TrajectoryFeedback,
)


@pytest.mark.parametrize("seconds", [0.0, 1.0 / 240.0, 0.9999999999, 12.5, 1234567.000000001])
def test_time_round_trip(seconds):
    assert conversions.time_from_msg(conversions.time_to_msg(seconds)) == pytest.approx(seconds, abs=1e-9)


def test_image_round_trips():
    rng = np.random.default_rng(0)
    color = rng.integers(0, 256, (54, 96, 3), dtype=np.uint8)
    depth = rng.random((54, 96), dtype=np.float32)
    depth[3, 4] = np.nan
    for pixels, encoding, step in ((color, "rgb8", 288), (depth, "32FC1", 384)):
        msg = conversions.image_to_msg(pixels, encoding, "camera", 1.5)
        assert (msg.height, msg.width, msg.encoding, msg.step) == (54, 96, encoding, step)
        assert (msg.header.frame_id, conversions.time_from_msg(msg.header.stamp)) == ("camera", 1.5)
        np.testing.assert_array_equal(conversions.image_from_msg(msg), pixels)
    view = color[:, ::-1]
    msg = conversions.image_to_msg(view, "rgb8", "", 0.0)
    np.testing.assert_array_equal(conversions.image_from_msg(msg), view)


def test_image_of_the_wrong_kind():
    with pytest.raises(ValueError, match="uint8"):
        conversions.image_to_msg(np.zeros((2, 2), np.float32), "rgb8", "", 0.0)


def test_large_images_are_not_copied_byte_by_byte():
    pixels = np.zeros((540, 960, 3), np.uint8)
    best = min(_seconds(lambda: conversions.image_to_msg(pixels, "rgb8", "", 0.0)) for _ in range(5))
    assert best < 0.01


def _seconds(function):
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def test_camera_info():
    msg = conversions.camera_info_to_msg(CameraModel(960, 540, 540.0, 541.0, 480.0, 270.0), "camera", 0.0)
    assert list(msg.k) == [540.0, 0.0, 480.0, 0.0, 541.0, 270.0, 0.0, 0.0, 1.0]
    assert list(msg.p)[:4] == [540.0, 0.0, 480.0, 0.0]
    assert len(msg.d) == 5


def test_transform():
    pose = Pose.from_xyz_rpy((0.1, 0.2, 0.3), (0.4, -0.5, 0.6))
    msg = conversions.transform_to_msg(pose, "base", "camera", 2.0)
    t, q = msg.transform.translation, msg.transform.rotation
    back = Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (t.x, t.y, t.z))
    np.testing.assert_allclose(back.rotation, pose.rotation, atol=1e-12)
    np.testing.assert_allclose(back.translation, pose.translation)
    assert (msg.header.frame_id, msg.child_frame_id) == ("base", "camera")


def test_joint_state():
    msg = conversions.joint_state_to_msg(["a", "b"], [1.0, 2.0], [3.0, 4.0], [5.0, 6.0], 0.25)
    assert (msg.name, list(msg.position), list(msg.velocity), list(msg.effort)) == (
        ["a", "b"],
        [1.0, 2.0],
        [3.0, 4.0],
        [5.0, 6.0],
    )


def test_trajectory_goal():
    msg = FollowJointTrajectory.Goal()
    msg.trajectory.joint_names = ["a", "b"]
    msg.trajectory.points = [
        JointTrajectoryPoint(positions=[1.0, 2.0], time_from_start=Duration(sec=1, nanosec=500_000_000)),
        JointTrajectoryPoint(positions=[3.0, 4.0], velocities=[0.0, 0.0], time_from_start=Duration(sec=2)),
    ]
    msg.path_tolerance = [JointToleranceMsg(name="a", position=0.1, velocity=-1.0)]
    msg.goal_time_tolerance = Duration(sec=3)
    goal = conversions.trajectory_goal_from_msg(msg)
    assert goal.joint_names == ("a", "b")
    assert goal.start_time is None
    assert [(p.time, p.positions, p.velocities, p.accelerations) for p in goal.points] == [
        (1.5, (1.0, 2.0), (), ()),
        (2.0, (3.0, 4.0), (0.0, 0.0), ()),
    ]
    assert goal.path_tolerance == {"a": JointTolerance(0.1, -1.0)}
    assert goal.goal_time_tolerance == 3.0
    msg.trajectory.header.stamp.sec = 7
    assert conversions.trajectory_goal_from_msg(msg).start_time == 7.0
    msg.multi_dof_trajectory.points = [MultiDOFJointTrajectoryPoint()]
    with pytest.raises(GoalRejectedError, match="multi-DOF"):
        conversions.trajectory_goal_from_msg(msg)


def test_trajectory_feedback():
    desired = JointCommand(np.array([1.0, 2.0]), np.array([0.1, 0.2]), np.array([0.0, 0.0]))
    feedback = TrajectoryFeedback(4.5, desired, np.array([0.9, 2.1]), np.array([0.1, 0.0]))
    msg = conversions.trajectory_feedback_to_msg(feedback, ["a", "b"])
    assert msg.joint_names == ["a", "b"]
    assert list(msg.error.positions) == pytest.approx([0.1, -0.1])
    assert list(msg.desired.velocities) == [0.1, 0.2]
    assert msg.header.stamp.sec == 4


def test_gripper():
    msg = GripperCommand.Goal()
    msg.command.position, msg.command.max_effort = 0.02, 15.0
    goal = conversions.gripper_goal_from_msg(msg)
    assert (goal.position, goal.max_effort) == (0.02, 15.0)
    for convert in (conversions.gripper_result_to_msg, conversions.gripper_feedback_to_msg):
        answer = convert(GripperResult(0.04, 20.0, False, True))
        assert (answer.position, answer.effort) == (0.04, 20.0)
        assert (answer.stalled, answer.reached_goal) == (False, True)
