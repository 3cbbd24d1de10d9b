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

from cliport_core import Heightmap, WorkspaceSpec, messages
from cliport_core.ros_rgbd import SLOP_S, RawFrame, RawReceived
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, save_calibration
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_health import HealthLimits
from cliport_perception.conversions import camera_to_msg
from cliport_perception.depth_correction import DepthCorrection
from cliport_perception.errors import CalibrationError, UnfitFrameError
from cliport_perception.node_camera import CameraSettings, CameraStream

FRAME = "camera_color_optical_frame"
SETTINGS = CameraSettings(WorkspaceSpec(), HealthLimits(), 0.0, 0.0, 0.3, None, 1, False, False, SLOP_S)
MakeStream = Callable[..., tuple[CameraStream, list[Heightmap]]]


@pytest.fixture
def make_stream(box_scene) -> Iterator[MakeStream]:
    rclpy.init(domain_id=next_domain())
    nodes: list[Node] = []

    def make(*parameters: Parameter, settings: CameraSettings = SETTINGS) -> tuple[CameraStream, list[Heightmap]]:
        nodes.append(Node("perception", parameter_overrides=list(parameters)))
        seen: list[Heightmap] = []
        place = lambda frame: box_scene.camera_in_base  # noqa: E731
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
