"""The camera of the node, handed the messages that a camera would send."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from ros_domain import next_domain
from sensor_msgs.msg import CompressedImage, JointState
from station_fakes import FakeTable
from tf2_msgs.msg import TFMessage

from cliport_core import messages as shared
from cliport_core import topics
from cliport_core.compressed_depth import encode_compressed_depth
from cliport_core.errors import CoreError
from cliport_core.heightmap import Heightmap
from cliport_core.image_files import encode_png
from cliport_core.images import decode_depth
from cliport_core.raw_image import image_of_raw
from cliport_core.ros_rgbd import RawFrame, RawReceived
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.observation import observation_from_messages
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, save_calibration
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.conversions import camera_to_msg
from cliport_perception.depth_correction import DepthCorrection
from demo_tool.conversions import scene_from_raw
from demo_tool.live_view import LiveView
from demo_tool.ros_camera import RosCamera
from demo_tool.ros_link import RosLink
from demo_tool.station import Station
from demo_tool.station_config import StationConfig
from demo_tool.steps import setup_of

FRAME = "camera_color_optical_frame"


@pytest.fixture(autouse=True)
def graph() -> Iterator[None]:
    rclpy.init(domain_id=next_domain())
    yield
    rclpy.try_shutdown()


def attached(root: Path, *parameters: Parameter) -> tuple[RosLink, RosCamera, Station]:
    link = RosLink(list(parameters))
    station = Station(link.config, link.arm, link.policy, root)
    return link, RosCamera(link, link.config.base_frame, station, lambda: 1, link.pictures), station


@pytest.mark.parametrize(("rectified", "larger"), [(False, 1.0), (True, 1.25)])
def test_rectified_pictures_have_no_distortion(tmp_path: Path, rectified: bool, larger: float) -> None:
    """One camera_info is sent for both: K and D are those of raw pictures, P is that of rectified ones."""
    table = FakeTable()
    view = table.live_view(0)
    info = camera_to_msg(replace(view.camera, distortion_model="plumb_bob", distortion=(0.1, -0.2, 0.0, 0.0, 0.05)))
    projection = info.p
    projection[0] = projection[5] = 1.25 * view.camera.fx
    info.p = projection
    messages = [shared.image_to_msg(view.color, "rgb8"), shared.image_to_msg(view.depth_m, "32FC1"), info]
    for message in messages:
        message.header.frame_id = FRAME
    transform = TransformStamped(child_frame_id=FRAME)
    transform.header.frame_id = "panda_link0"
    transform.transform = shared.pose_to_transform_msg(table.camera_in_base)
    link, camera, station = attached(tmp_path, Parameter("rectified", value=rectified))
    seen: list[LiveView] = []
    station.on_camera = seen.append  # type: ignore[method-assign]
    camera._on_static(serialize_message(TFMessage(transforms=[transform])))
    camera._on_frame(RawFrame(*(RawReceived(serialize_message(message), 1) for message in messages), 1, FRAME))
    link.destroy_node()
    assert seen[0].camera.fx == pytest.approx(larger * view.camera.fx)
    assert seen[0].camera.is_distorted is not rectified


def test_a_camera_whose_place_is_not_known_is_shown_to_be_calibrated(tmp_path: Path) -> None:
    view = FakeTable().live_view(0)
    messages = [
        shared.image_to_msg(view.color, "rgb8"), shared.image_to_msg(view.depth_m, "32FC1"), camera_to_msg(view.camera)
    ]  # fmt: skip
    link, camera, station = attached(tmp_path)
    frame = RawFrame(*(RawReceived(serialize_message(message), 1) for message in messages), 7, FRAME)
    with pytest.raises(CoreError, match="no transform"):
        camera._on_frame(frame)
    link.destroy_node()
    shown = station.picture("camera", 0, 0.0)
    assert shown is not None and shown.stamp_ns == 7 and np.array_equal(shown.pixels, view.color)
    assert station.picture("color", 0, 0.0) is None


def test_a_link_without_a_station_ends_well() -> None:
    link = RosLink()
    link._tick()
    link.close()
    link.destroy_node()


def placed_frame(root: Path, parameters: list[Parameter], messages: list[Any], frame: str = FRAME) -> LiveView:
    """What the station is shown of one frame."""
    transform = TransformStamped(child_frame_id=frame)
    transform.header.frame_id = "panda_link0"
    transform.transform = shared.pose_to_transform_msg(FakeTable().camera_in_base)
    link, camera, station = attached(root, *parameters)
    seen: list[LiveView] = []
    station.on_camera = seen.append  # type: ignore[method-assign]
    camera._on_static(serialize_message(TFMessage(transforms=[transform])))
    for message in messages:
        message.header.frame_id = frame
    camera._on_frame(RawFrame(*(RawReceived(serialize_message(message), 1) for message in messages), 1, frame))
    link.destroy_node()
    return seen[0]


@pytest.mark.parametrize("encoding", ["16UC1", "32FC1"])
def test_compressed_pictures_are_shown_and_recorded_as_raw_ones(tmp_path: Path, encoding: str) -> None:
    view = FakeTable().live_view(0)
    form, packed = encode_compressed_depth(view.depth_m, encoding)
    pictures = [
        CompressedImage(format="rgb8; png compressed bgr8", data=encode_png(view.color)),
        CompressedImage(format=form, data=packed),
    ]
    messages = [*pictures, camera_to_msg(view.camera)]
    shown = placed_frame(tmp_path, [Parameter("compressed", value=True)], messages)
    np.testing.assert_array_equal(shown.color, view.color)
    np.testing.assert_allclose(shown.depth_m, view.depth_m, atol=0.003)
    config = StationConfig()
    seen = observation_from_messages(shown.to_record(), "step 0", setup_of(shown, config))
    np.testing.assert_array_equal(seen.color, view.color)
    np.testing.assert_allclose(seen.depth_m, shown.depth_m, atol=1e-6)


def test_depth_is_shown_corrected_and_recorded_as_measured(tmp_path: Path) -> None:
    view, file = FakeTable().live_view(0), tmp_path / "camera.yaml"
    off = DepthCorrection(1.01, -0.004)
    camera, made = CameraCalibration(view.camera, view.camera_in_base), datetime.now(timezone.utc)
    save_calibration(
        file, CalibrationRecord(camera, made, Method.STATIC, "panda_link0", FRAME, depth=off, table_z=0.005)
    )
    images = [shared.image_to_msg(view.color, "rgb8"), shared.image_to_msg(view.depth_m, "32FC1")]
    given = [Parameter("calibration", value=str(file))]
    shown = placed_frame(tmp_path, given, [*images, camera_to_msg(view.camera)])
    np.testing.assert_allclose(shown.depth_m, 1.01 * view.depth_m - 0.004, atol=1e-6)
    setup = setup_of(shown, StationConfig())
    assert setup.depth == off
    depths = [raw for raw in shown.to_record() if raw.topic == topics.DEPTH]
    np.testing.assert_array_equal(decode_depth(image_of_raw(depths[0].data)), view.depth_m)
    read = observation_from_messages(shown.to_record(), "step 0", setup)
    np.testing.assert_allclose(read.depth_m, shown.depth_m, atol=1e-6)
    link = RosLink(given)
    assert link.config.box.table_z == 0.005
    link.destroy_node()


def test_a_camera_that_sends_nothing_is_named(tmp_path: Path) -> None:
    link, _, station = attached(tmp_path)
    words = station.view(None)["words"]
    link.destroy_node()
    assert "/camera/color/image_raw" in words and "/camera/aligned_depth_to_color/image_raw" in words


def test_the_scene_is_shown_as_seen_from_behind_the_robot() -> None:
    """+x is up and +y to the left; what was not seen is grey."""
    workspace = WorkspaceSpec(x_min=0.0, x_max=0.02, y_min=0.0, y_max=0.03, pixel_size=0.01)
    color = np.arange(3 * 2 * 3, dtype=np.uint8).reshape(3, 2, 3)
    valid = np.ones((3, 2), dtype=np.bool_)
    valid[0, 1] = False
    seen = Heightmap(color, np.zeros((3, 2), np.float32), valid, workspace)
    shown = scene_from_raw(serialize_message(shared.heightmap_to_msg(seen, "panda_link0")))
    assert shown.shape == (2, 3, 3)
    for row in range(2):
        for col in range(3):
            y, x = 2 - col, 1 - row
            assert shown[row, col].tolist() == (color[y, x].tolist() if (y, x) != (0, 1) else [40, 40, 40])


def test_joints_are_heard_for_a_second(tmp_path: Path) -> None:
    link, camera, _ = attached(tmp_path)
    now = [10_000_000_000]
    camera._now_ns = lambda: now[0]
    camera._on_joints(serialize_message(JointState(name=["a", "b"], position=[0.25, 0.5])))
    camera._on_joints(serialize_message(JointState(name=["finger"], position=[])))
    now[0] += 600_000_000
    camera._on_joints(serialize_message(JointState(name=["c"], position=[0.75])))
    assert camera.joint_positions() == {"a": 0.25, "b": 0.5, "c": 0.75}
    now[0] += 400_000_000
    assert camera.joint_positions() == {"a": 0.25, "b": 0.5, "c": 0.75}
    now[0] += 1
    assert camera.joint_positions() == {"c": 0.75}
    now[0] -= 3_000_000_000  # the clock was set back
    assert camera.joint_positions() == {}
    link.destroy_node()


def test_a_transform_that_is_none_is_said_and_the_others_are_kept(tmp_path: Path) -> None:
    link, camera, station = attached(tmp_path)
    links = [TransformStamped(child_frame_id=name) for name in ("bad", "camera")]
    for each in links:
        each.header.frame_id = "panda_link0"
    links[0].transform.rotation.w = 0.0
    links[1].transform.translation.x = 0.5
    camera._on_static(serialize_message(TFMessage(transforms=links)))
    assert station.view(None)["words"].startswith("The transform of 'bad' is ignored: ")
    assert camera._transforms.source_in_target("camera", "panda_link0").translation.tolist() == [0.5, 0.0, 0.0]
    link.destroy_node()
