"""`calibrate --verify` over ROS: frames of a camera become numbers on depth and table, and a picture."""

from __future__ import annotations

import re
import threading
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message
from ros_domain import next_domain
from sensor_msgs.msg import CameraInfo, Image

from cliport_core import Pose, messages, topics
from cliport_core.errors import FrameError
from cliport_core.ros_rgbd import RawFrame, RawReceived
from cliport_perception import CameraModel, conversions
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.calibration_file import (
    CalibrationRecord,
    Method,
    load_calibration,
    save_calibration,
)
from cliport_perception.calibration.cli import main
from cliport_perception.calibration.ros_verify import OneFrame
from cliport_perception.calibration.synthetic import SyntheticCamera
from cliport_perception.camera_file import CameraCalibration

LENS = CameraModel(960, 540, 800.0, 801.0, 482.0, 268.0, "plumb_bob", (0.05, -0.05, 0.001, -0.0005, 0.0))
POSE = Pose.looking_at((1.1, -0.1, 0.75), (0.48, -0.05, 0.0))
LYING = Pose.from_xyz_rpy((0.35, -0.12, 0.0), (np.pi, 0.0, 0.2))
BOARD = Board()
SCALE, OFFSET = 1.01, -0.004


def test_verify_reports_depth_and_the_executors_table_height(
    cast_scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    domain = next_domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    calibration = tmp_path / "camera.yaml"
    camera = CameraCalibration(LENS, POSE)
    frame = "camera_color_optical_frame"
    record = CalibrationRecord(camera, datetime.now(timezone.utc), Method.STATIC, "panda_link0", frame)
    save_calibration(calibration, record)
    picture = SyntheticCamera(BOARD, LENS).picture(POSE.inverse() @ LYING, np.random.default_rng(0))
    color = messages.image_to_msg(np.repeat(picture[..., None], 3, axis=2), "rgb8")
    depth = messages.image_to_msg((cast_scene(LENS, POSE).depth - OFFSET) / SCALE, "32FC1")
    stop = threading.Event()
    thread = threading.Thread(target=show, args=(domain, color, depth, stop))
    thread.start()
    try:
        status = main(["--verify", str(tmp_path / "check.png"), "--apply-depth", "--calibration", str(calibration)])
    finally:
        stop.set()
        thread.join()
    out = capsys.readouterr().out
    assert status == 0 and (tmp_path / "check.png").is_file()
    found = re.search(
        r"depth: true = ([\d.]+) \(\+-([\d.]+)\) x measured ([-+][\d.]+) mm \(\+-([\d.]+)\), from table", out
    )
    assert found, out
    scale, scale_3, offset, offset_3 = map(float, found.groups())
    assert abs(scale - SCALE) < scale_3 < 0.02 and abs(offset - 1e3 * OFFSET) < offset_3 < 10.0
    assert re.search(r"table_z: perception sees .* in panda_link0: set the executor's table_z to -?0\.00\d\d\n", out)
    known = load_calibration(calibration)
    assert known.depth is not None and known.table_z is not None
    assert known.depth.scale == pytest.approx(SCALE, abs=scale_3) and abs(known.table_z) < 0.005
    assert len(list(tmp_path.glob("camera.*.yaml"))) == 1, "the calibration that was there is kept"


def test_the_check_registers_depth_of_another_frame(cast_scene) -> None:
    rclpy.init(args=["--ros-args", "-p", "depth_camera_info:=/camera/depth/camera_info"], domain_id=next_domain())
    node = OneFrame()
    try:
        beside = Pose.from_xyz_rpy((-0.05, 0.01, 0.0), (0.0, -0.02, 0.01))
        sensor = CameraModel(320, 240, 190.0, 190.0, 159.0, 121.0)
        true, raw = cast_scene(LENS, POSE), cast_scene(sensor, POSE @ beside)
        sent = [messages.image_to_msg(true.color, "rgb8"), messages.image_to_msg(raw.depth, "32FC1")]
        sent += [conversions.camera_to_msg(LENS), conversions.camera_to_msg(sensor)]
        color, depth, info, depth_info = (RawReceived(serialize_message(message), 1) for message in sent)
        frame = RawFrame(color, depth, info, 1, "color", "depth", depth_info)
        with pytest.raises(FrameError, match="no transform"):
            node.images(frame, LENS)
        node.tree.put("color", "depth", beside)
        seen = node.images(frame, LENS)
        assert seen.depth_m.shape == true.depth.shape
        off = np.abs(seen.depth_m - true.depth)
        assert np.isfinite(off).mean() > 0.5 and np.nanmedian(off) < 0.002
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def show(domain: int, color: Image, depth: Image, stop: threading.Event) -> None:
    """Publish one view again and again, from a life of its own."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("camera", context=context)
    info = conversions.camera_to_msg(LENS)
    sent = ((CameraInfo, topics.CAMERA_INFO, info), (Image, topics.COLOR, color), (Image, topics.DEPTH, depth))
    publishers = [(node.create_publisher(kind, name, qos_profile_sensor_data), message) for kind, name, message in sent]
    stamp_ns = 0
    while not stop.wait(0.1):
        stamp_ns += 100_000_000
        for publisher, message in publishers:
            message.header.frame_id = "camera_color_optical_frame"
            message.header.stamp = messages.stamp_to_msg(stamp_ns)
            publisher.publish(message)
    node.destroy_node()
    context.try_shutdown()
