"""Messages and back."""

from __future__ import annotations

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory
from rclpy.serialization import deserialize_message, serialize_message
from ros_clouds import raw_cloud
from sensor_msgs.msg import PointCloud2

from cliport_core.action import Primitive
from cliport_core.messages import stamp_to_msg
from cliport_core.outcome import Outcome
from cliport_interfaces.action import PickPlace
from panda_executor import conversions
from panda_executor.cloud_cache import stamp_of_raw
from panda_executor.errors import RequestError
from panda_executor.health import HealthReport
from panda_executor.phase import Phase
from panda_executor.trajectory import JointTrajectory
from panda_model import load_preset, preset_names

FRAME = "panda_link0"
STAMP = 1_700_000_000_123_456_789


def test_the_enums_are_the_actions_constants() -> None:
    for enum, message, prefix in (
        (Outcome, PickPlace.Result, "OUTCOME_"),
        (Phase, PickPlace.Feedback, "PHASE_"),
        (Primitive, PickPlace.Goal, "PRIMITIVE_"),
    ):
        assert {name: int(value) for name, value in enum.__members__.items()} == {
            name: getattr(message, prefix + name) for name in enum.__members__
        }


@pytest.mark.parametrize("seconds", [0.0, 0.02, 1.999999999, 12.3456789])
def test_durations(seconds: float) -> None:
    message = conversions.duration_to_msg(seconds)
    assert message.nanosec < 1_000_000_000
    assert conversions.duration_from_msg(message) == pytest.approx(seconds, abs=1e-9)


@pytest.mark.parametrize("preset", [load_preset(name) for name in preset_names()], ids=preset_names())
def test_trajectories(preset) -> None:
    random = np.random.default_rng(0)
    rows = [random.normal(size=(5, 7)) for _ in range(3)]
    trajectory = JointTrajectory(load_preset().arm_joints, np.arange(5) * 0.02, *rows)
    message = conversions.trajectory_to_msg(trajectory, preset.arm_joints)
    assert tuple(message.joint_names) == preset.arm_joints
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (0, 0)
    message.joint_names.reverse()
    for point in message.points:
        for name in ("positions", "velocities", "accelerations"):
            setattr(point, name, getattr(point, name)[::-1])
    back = conversions.trajectory_from_msg(message, preset.arm_joints)
    for name in ("times", "positions", "velocities", "accelerations"):
        np.testing.assert_allclose(getattr(back, name), getattr(trajectory, name), atol=1e-9)
    with pytest.raises(ValueError, match="nowhere"):
        conversions.trajectory_from_msg(message, ("nowhere",))


def test_feedback_and_diagnostics() -> None:
    feedback = conversions.feedback_to_msg(Phase.CARRY, 0.6)
    assert (feedback.phase, feedback.phase_name) == (6, "CARRY")
    assert feedback.progress == pytest.approx(0.6)
    message = conversions.diagnostics_to_msg(HealthReport(2, "gone", {"a": "b"}), STAMP)
    assert (message.status[0].level, message.status[0].message) == (b"\x02", "gone")
    assert message.header.stamp == stamp_to_msg(STAMP)


def test_the_gripper_is_told_half_of_the_width() -> None:
    command = conversions.gripper_goal_to_msg(0.08, 20.0).command
    assert (command.position, command.max_effort) == (0.04, 20.0)


def test_a_failed_motion_is_one_line() -> None:
    result = FollowJointTrajectory.Result
    assert conversions.motion_message(result(error_code=result.INVALID_JOINTS)) == "invalid joints"
    message = conversions.motion_message(result(error_code=-4, error_string="joint 3\n is late"))
    assert message == "path tolerance violated: joint 3 is late"
    assert conversions.motion_message(result(error_code=-99)) == "error code -99"
    assert (
        conversions.motion_message(result(error_code=-4, error_string="too far")) == "path tolerance violated: too far"
    )
    said = result(error_code=-4, error_string="path tolerance violated")
    assert conversions.motion_message(said) == "path tolerance violated", "not twice"


def test_a_raw_cloud() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    points[7] = np.nan
    raw = raw_cloud(points, STAMP)
    assert stamp_of_raw(raw) == STAMP
    np.testing.assert_array_equal(conversions.cloud_from_raw(raw, FRAME), points)
    with pytest.raises(RequestError, match="in frame 'panda_link0', expected 'fr3_link0'"):
        conversions.cloud_from_raw(raw, "fr3_link0")
    bare: PointCloud2 = deserialize_message(raw, PointCloud2)
    bare.fields = []
    with pytest.raises(RequestError):
        conversions.cloud_from_raw(serialize_message(bare), FRAME)
