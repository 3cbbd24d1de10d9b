"""One camera of the perception node, handed the messages that a camera would send."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from ros_domain import next_domain

from cliport_core import Heightmap, Pose, WorkspaceSpec, messages
from cliport_core.ros_rgbd import SLOP_S, RawFrame, RawReceived
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, save_calibration
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_health import HealthLimits
from cliport_perception.camera_model import CameraModel
from cliport_perception.conversions import camera_to_msg
from cliport_perception.depth_correction import DepthCorrection
from cliport_perception.errors import CalibrationError, UnfitFrameError
from cliport_perception.node_camera import CameraSettings, CameraStream

FRAME = "camera_color_optical_frame"
SETTINGS = CameraSettings(WorkspaceSpec(), HealthLimits(), 0.0, 0.0, 0.3, None, 0.0, 1, False, False, SLOP_S)
DEPTH_FRAME, DEPTH_INFO = "camera_depth_optical_frame", "/camera/depth/camera_info"
DEPTH_IN_COLOR = Pose.from_xyz_rpy((-0.05, 0.01, 0.0), (0.0, -0.02, 0.01))
MakeStream = Callable[..., tuple[CameraStream, list[Heightmap]]]


@pytest.fixture
def make_stream(box_scene) -> Iterator[MakeStream]:
    rclpy.init(domain_id=next_domain())
    nodes: list[Node] = []

    def make(*parameters: Parameter, settings: CameraSettings = SETTINGS) -> tuple[CameraStream, list[Heightmap]]:
        nodes.append(Node("perception", parameter_overrides=list(parameters)))
        seen: list[Heightmap] = []
        beside = box_scene.camera_in_base @ DEPTH_IN_COLOR
        place = lambda frame: beside if frame == DEPTH_FRAME else box_scene.camera_in_base  # noqa: E731
        serve = lambda number, products: seen.append(products.heightmap)  # noqa: E731
        return CameraStream(nodes[-1], 1, settings, place, serve), seen

    yield make
    for node in nodes:
        node.destroy_node()
    rclpy.try_shutdown()


def frame_of(scene, depth: np.ndarray, stream: CameraStream, frame: str = FRAME) -> RawFrame:
    now_ns = stream._now_ns()
    sent = (
        messages.image_to_msg(scene.color, "rgb8"),
        messages.image_to_msg(depth, "32FC1"),
        camera_to_msg(scene.camera),
    )
    for message in sent:
        message.header.frame_id = frame
    return RawFrame(*(RawReceived(serialize_message(message), now_ns) for message in sent), now_ns, frame)


def test_depth_is_corrected_as_the_calibration_says(make_stream: MakeStream, box_scene, tmp_path: Path) -> None:
    file, off = tmp_path / "camera.yaml", DepthCorrection(1.01, 0.01)
    camera = CameraCalibration(box_scene.camera, box_scene.camera_in_base)
    made = datetime.now(timezone.utc)
    record = CalibrationRecord(camera, made, Method.STATIC, "panda_link0", FRAME, depth=off, table_z=0.0)
    save_calibration(file, record)
    stream, seen = make_stream(Parameter("calibration", value=str(file)))
    measured = (box_scene.depth - np.float32(off.offset)) / np.float32(off.scale)
    stream._on_frame(frame_of(box_scene, measured, stream))
    on_cube, on_table = (WorkspaceSpec().xy_to_pixel(*xy) for xy in ((0.42, -0.08), (0.5, -0.2)))
    assert seen[-1].height[on_cube] == pytest.approx(0.04, abs=0.002)
    assert seen[-1].height[on_table] == pytest.approx(0.0, abs=0.002)
    alone, plain = make_stream()
    alone._on_frame(frame_of(box_scene, measured, alone))
    assert plain[-1].height[on_table] > 0.008, "as it was measured, the table is too high"
    with pytest.raises(UnfitFrameError, match="give this camera's own calibration"):
        stream._on_frame(frame_of(box_scene, measured, stream, "another_frame"))
    save_calibration(file, replace(record, depth=None))
    stream.report()
    stream._on_frame(frame_of(box_scene, measured, stream))
    assert seen[-1].height[on_table] > 0.008, "the file was not read again"


def test_a_calibration_that_is_not_there_is_named(make_stream: MakeStream) -> None:
    with pytest.raises(CalibrationError, match="cannot read"):
        make_stream(Parameter("calibration", value="/nowhere/camera.yaml"))


@pytest.mark.parametrize("decimation", [1, 2])
def test_depth_of_another_camera_is_registered(make_stream: MakeStream, cast_scene, box_scene, decimation: int) -> None:
    sensor = CameraModel(640, 480, 380.0, 380.0, 318.0, 242.0)
    raw = cast_scene(sensor, box_scene.camera_in_base @ DEPTH_IN_COLOR)
    settings = replace(SETTINGS, decimation=decimation)
    stream, seen = make_stream(Parameter("depth_camera_info", value=DEPTH_INFO), settings=settings)
    assert stream._input.topic_names["depth_info"] == DEPTH_INFO
    frame = frame_of(box_scene, raw.depth, stream)
    info = RawReceived(serialize_message(camera_to_msg(sensor)), frame.stamp_ns)
    stream._on_frame(frame._replace(depth_frame_id=DEPTH_FRAME, depth_info=info))
    spec = WorkspaceSpec()
    on_cube, on_table = (spec.xy_to_pixel(*xy) for xy in ((0.42, -0.08), (0.5, -0.2)))
    assert seen[-1].height[on_cube] == pytest.approx(0.04, abs=0.003)
    assert seen[-1].height[on_table] == pytest.approx(0.0, abs=0.003)
    assert tuple(seen[-1].color[on_cube]) == (200, 30, 30), "depth and colour are not of one place"
    assert seen[-1].valid_fraction > 0.8


def test_a_large_picture_is_made_smaller(make_stream: MakeStream, box_scene) -> None:
    stream, seen = make_stream(settings=replace(SETTINGS, decimation=2))
    stream._on_frame(frame_of(box_scene, box_scene.depth, stream))
    spec = WorkspaceSpec()
    on_cube, on_table = (spec.xy_to_pixel(*xy) for xy in ((0.42, -0.08), (0.5, -0.2)))
    assert seen[-1].height[on_cube] == pytest.approx(0.04, abs=0.002)
    assert seen[-1].height[on_table] == pytest.approx(0.0, abs=0.002)
    assert stream._processor._builders is not None and stream._processor._builders[1].camera.width == 480
