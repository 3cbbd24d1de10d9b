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
from cliport_core.pose import Pose
from cliport_interfaces.action import PickPlace
from panda_executor import conversions
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import stamp_of_raw
from panda_executor.errors import RequestError
from panda_executor.health import HealthReport
from panda_executor.phase import Phase
from panda_executor.surroundings import Surroundings
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


def test_a_goals_tolerances_are_for_every_joint_in_order() -> None:
    names = load_preset("fr3").arm_joints
    rows = [np.arange(14.0).reshape(2, 7) + shift for shift in (0.0, 100.0, 200.0)]
    trajectory = JointTrajectory(load_preset().arm_joints, np.array([0.0, 2.25]), *rows)
    goal = conversions.trajectory_goal_to_msg(trajectory, names, 0.1, 0.02, 1.5)
    assert goal.trajectory == conversions.trajectory_to_msg(trajectory, names)
    for tolerances, allowed in ((goal.path_tolerance, 0.1), (goal.goal_tolerance, 0.02)):
        assert [(t.name, t.position, t.velocity, t.acceleration) for t in tolerances] == [
            (name, allowed, 0.0, 0.0) for name in names
        ]
    assert (goal.goal_time_tolerance.sec, goal.goal_time_tolerance.nanosec) == (1, 500_000_000)
    last = goal.trajectory.points[1]
    assert (last.time_from_start.sec, last.time_from_start.nanosec) == (2, 250_000_000)
    for found, row in zip((last.positions, last.velocities, last.accelerations), rows, strict=True):
        assert found.tolist() == row[1].tolist()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("INVALID_GOAL", "invalid goal"),
        ("INVALID_JOINTS", "invalid joints"),
        ("OLD_HEADER_TIMESTAMP", "old header timestamp"),
        ("PATH_TOLERANCE_VIOLATED", "path tolerance violated"),
        ("GOAL_TOLERANCE_VIOLATED", "goal tolerance violated"),
    ],
)
def test_each_failure_of_the_controller_has_words(code: str, words: str) -> None:
    result = FollowJointTrajectory.Result
    assert conversions.motion_message(result(error_code=getattr(result, code))) == words


def test_a_report_names_the_arm_and_carries_its_values_in_order() -> None:
    report = HealthReport(1, "old", {"b": "1", "a": "2"})
    (status,) = conversions.diagnostics_to_msg(report, STAMP).status
    assert (status.name, status.hardware_id) == ("panda_executor: arm", "arm")
    assert [(value.key, value.value) for value in status.values] == [("b", "1"), ("a", "2")]
    feedback = conversions.feedback_to_msg(Phase.LOWER, 0.25, "plan 7")
    assert (feedback.plan_id, feedback.progress) == ("plan 7", 0.25)
    assert conversions.feedback_to_msg(Phase.LOWER, 0.25).plan_id == ""


class Clouds:
    """A cache and a planner that write down what they are asked, the time being 5 ns."""

    def __init__(self, raw: bytes | None) -> None:
        self.raw, self.asked = raw, list[object]()

    def get(self, *given: int) -> bytes:
        self.asked.append(given)
        if self.raw is None:
            raise RequestError("the point cloud is old")
        return self.raw

    def place_cameras(self, position: np.ndarray) -> None:
        self.asked.append(position.tolist())


def around(clouds: Clouds, frame: str = FRAME) -> Surroundings:
    camera = CameraPlace("base")
    camera.see("lens")
    camera.put("base", "lens", Pose(np.eye(3), np.array([0.9, 0.1, 0.8])))
    return Surroundings(clouds, clouds, camera, frame, lambda: 5)  # type: ignore[arg-type]


def test_a_persons_motion_avoids_the_newest_cloud_and_the_camera() -> None:
    points = np.random.default_rng(0).normal(size=(5, 3)).astype(np.float32)
    fresh = Clouds(raw_cloud(points, STAMP))
    found = around(fresh).cloud()
    assert found is not None
    np.testing.assert_array_equal(found, points)
    assert fresh.asked == [[0.9, 0.1, 0.8], (5, 0, 0)]
    assert around(fresh).missing() == "" and fresh.asked[2:] == [(5, 0, 0)], "a question moves no camera"
    assert around(fresh, "elsewhere").cloud() is None


def test_without_a_cloud_a_persons_motion_avoids_the_camera_and_says_so() -> None:
    old = Clouds(None)
    assert around(old).cloud() is None and old.asked == [[0.9, 0.1, 0.8], (5, 0, 0)]
    words = "only the arm itself, the table, the camera and its post are avoided: the point cloud is old"
    assert around(old).missing() == words


def test_without_a_cameras_place_a_persons_motion_is_refused() -> None:
    clouds = Clouds(None)
    unknown = Surroundings(clouds, clouds, CameraPlace("base"), FRAME, lambda: 5)  # type: ignore[arg-type]
    for call in (unknown.missing, unknown.cloud):
        with pytest.raises(RequestError, match="where the camera stands is not known"):
            call()
    assert clouds.asked == []
