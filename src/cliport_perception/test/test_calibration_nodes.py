"""Calibration over ROS: pictures to a saved file, and a file to /tf_static and /diagnostics."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from ros_domain import next_domain
from ros_until import until
from sensor_msgs.msg import CameraInfo, Image
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from cliport_core.pose import Pose
from cliport_perception import CameraModel, conversions
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, save_calibration
from cliport_perception.calibration.cli import main as calibrate
from cliport_perception.calibration.node_camera_pose import CameraPoseNode, main
from cliport_perception.calibration.procedures import KnownBoardProcedure, Voice
from cliport_perception.calibration.ros_live import LiveCalibration, _solved
from cliport_perception.calibration.ros_session import ros_session
from cliport_perception.calibration.synthetic import SyntheticCamera
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.errors import CalibrationError

FRAME = "camera_color_optical_frame"
LENS = CameraModel(640, 480, 500.0, 500.0, 320.0, 240.0)
POSE = Pose.looking_at((0.9, 0.0, 0.8), (0.4, 0.0, 0.0))


def record(pose: Pose = POSE) -> CalibrationRecord:
    camera = CameraCalibration(LENS, pose)
    return CalibrationRecord(camera, datetime.now(timezone.utc), Method.STATIC, "panda_link0", FRAME)


@pytest.fixture
def ros() -> Iterator[Node]:
    rclpy.init(domain_id=next_domain())
    node = rclpy.create_node("someone")
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def links(node: Node) -> list[TransformStamped]:
    found: list[TransformStamped] = []
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(TFMessage, topics.TF_STATIC, lambda m: found.extend(m.transforms), latched)
    return found


def camera_pose_node(**parameters: str) -> CameraPoseNode:
    return CameraPoseNode(parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()])


def test_a_calibration_is_published_and_again_when_it_changes(ros: Node, tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    node = camera_pose_node(calibration=str(path))
    found = links(ros)
    reports: list[str] = []
    ros.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, lambda m: reports.append(m.status[0].message), 10)
    assert until([ros, node], lambda: bool(found) and bool(reports))
    assert (found[0].header.frame_id, found[0].child_frame_id) == ("panda_link0", FRAME)
    assert messages.pose_from_transform_msg(found[0].transform).is_close(POSE)
    assert "days old" in reports[0]
    moved = Pose(POSE.rotation, POSE.translation + np.array([0.1, 0.0, 0.0]))
    save_calibration(path, record(moved))
    assert until([ros, node], lambda: len(found) > 1)
    assert messages.pose_from_transform_msg(found[-1].transform).is_close(moved)
    node.destroy_node()


def test_a_driver_keeps_its_own_frames(ros: Node, tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    node = camera_pose_node(calibration=str(path), driver_frame="camera_link")
    found = links(ros)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    driver = ros.create_publisher(TFMessage, topics.TF_STATIC, latched)
    optical_in_root = Pose.from_xyz_rpy((0.0, 0.015, 0.0), (-np.pi / 2, 0.0, -np.pi / 2))
    link = TransformStamped(child_frame_id=FRAME, transform=messages.pose_to_transform_msg(optical_in_root))
    link.header.frame_id = "camera_link"
    driver.publish(TFMessage(transforms=[link]))
    assert until([ros, node], lambda: any(one.child_frame_id == "camera_link" for one in found))
    root = next(one for one in found if one.child_frame_id == "camera_link")
    root_in_base = messages.pose_from_transform_msg(root.transform)
    assert (root_in_base @ optical_in_root).is_close(POSE)
    node.destroy_node()


def test_a_bad_transform_is_ignored_and_a_silent_driver_is_an_error(ros: Node, tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    node = camera_pose_node(calibration=str(path), driver_frame="camera_link")
    bad = TransformStamped(child_frame_id=FRAME)
    bad.header.frame_id = "camera_link"
    bad.transform.rotation.w = 0.0
    node._on_tf(TFMessage(transforms=[bad]))
    reports: list[tuple[bytes, str]] = []
    ros.create_subscription(
        DiagnosticArray, topics.DIAGNOSTICS, lambda m: reports.append((m.status[0].level, m.status[0].message)), 10
    )
    assert until([ros, node], lambda: bool(reports))
    level, words = reports[0]
    assert level == DiagnosticStatus.ERROR and f"no transform from '{FRAME}' to driver_frame 'camera_link'" in words
    node.destroy_node()


def test_a_refusal_is_said_and_samples_go_on() -> None:
    said: list[str] = []
    made = record()

    class Refusing:
        is_complete = True
        refusals = 1

        def solve(self, frames: tuple[str, str], now: datetime) -> CalibrationRecord:
            if self.refusals:
                raise CalibrationError("take more samples")
            return made

        def extend(self) -> int:
            self.refusals -= 1
            return 5

    node = SimpleNamespace(procedure=Refusing(), camera_frame=FRAME)
    assert _solved(node, None, "base", Voice(said.append, said.append)) is made  # type: ignore[arg-type]
    assert said == ["nothing is saved yet: take more samples; 5 more samples follow, those taken are kept"]


def test_ros_arguments_that_make_no_sense_end_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["-r", "nonsense"], ["-p", "rectified:=soon"]):
        assert calibrate(["--out", str(tmp_path / "camera.yaml"), "--ros-args", *arguments]) == 1
        error = capsys.readouterr().err.strip().splitlines()[-1]
        assert error.startswith("error: ")
        assert not rclpy.ok()


def test_a_shutdown_from_outside_is_an_interruption() -> None:
    with pytest.raises(KeyboardInterrupt), ros_session([]):
        raise ExternalShutdownException
    assert not rclpy.ok()


@pytest.mark.parametrize("arguments", [[], ["--ros-args", "-p", "calibration:=/nowhere/camera.yaml"]])
def test_without_a_calibration_it_ends_in_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("error: ") and "\n" not in error


def test_pictures_over_ros_become_a_calibration(ros: Node, board_in_hand) -> None:
    world = board_in_hand._replace(placement=replace(board_in_hand.placement, board_in_gripper=Pose.identity()))
    lying = Pose.from_xyz_rpy((0.4, 0.1, 0.0), (np.pi, 0.0, 0.4))
    picture = SyntheticCamera(world.board, world.camera).picture(
        world.placement.board_in_camera(lying), np.random.default_rng(0)
    )
    said: list[str] = []
    voice = Voice(said.append, said.append)
    node = LiveCalibration(
        lambda camera: KnownBoardProcedure(world.board, lying, camera, 2, Method.FIXED_MARKER, voice),
        ("panda_link0", "panda_hand_tcp"),
        said.append,
    )
    color = ros.create_publisher(Image, topics.COLOR, qos_profile_sensor_data)
    info = ros.create_publisher(CameraInfo, topics.CAMERA_INFO, qos_profile_sensor_data)

    def blind() -> None:
        info.publish(CameraInfo(width=960, height=540))  # as a driver without a calibration has it

    assert until([ros, node], lambda: any("camera_info holds no K" in words for words in said), blind)
    assert node.procedure is None

    def show(frame: str = FRAME) -> None:
        info.publish(conversions.camera_to_msg(world.camera))
        message = messages.image_to_msg(np.repeat(picture[..., None], 3, axis=2), "bgr8")
        message.header.frame_id = frame
        color.publish(message)

    assert until([ros, node], lambda: any("frame_id is ''" in words for words in said), lambda: show(""))
    assert node.procedure is not None and not node.procedure.is_complete
    assert until([ros, node], lambda: node.procedure is not None and node.procedure.is_complete, show)
    assert node.procedure is not None
    found = node.procedure.solve(("panda_link0", node.camera_frame), datetime.now(timezone.utc))
    assert found.camera_frame == FRAME
    mm, _ = pose_difference(found.camera.camera_in_base, world.placement.camera_in_base)
    assert found.uncertainty is not None and mm < found.uncertainty.mm
    node.destroy_node()


def test_a_tied_calibration_ends_with_who_started_it(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cliport_perception.calibration.cli", "--tied", "--out", str(tmp_path / "c.yaml")]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(next_domain())}
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        assert process.stdout.readline().startswith("nothing received on"), "it runs"
        assert process.poll() is None
        process.stdin.close()
        assert process.wait(30) == 130
        assert process.stderr.read().strip() == "error: interrupted; nothing was written"
    assert not list(tmp_path.iterdir())
