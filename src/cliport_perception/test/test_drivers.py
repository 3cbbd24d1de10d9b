"""Messages in the exact form of real drivers, under the topics of their launch files, become the right heightmap."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pytest
import yaml
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, Image

from cliport_core import messages
from cliport_core.images import decode_color, decode_depth
from cliport_core.raw_image import image_of_raw
from cliport_core.workspace import WorkspaceSpec
from cliport_perception import CameraModel, heightmap_from_rgbd
from cliport_perception.conversions import CameraReader, camera_to_msg
from cliport_perception.errors import CameraModelError

LAUNCH = Path(__file__).resolve().parents[3] / "src/cliport_bringup/launch"


class Driver(NamedTuple):
    """What a driver publishes. depth_unit: of its depth [m]; padding: bytes after each row of colour."""

    launch: str
    color_topic: str
    depth_topic: str
    lens: CameraModel
    color: str
    depth: str
    rectified: bool = False
    padding: int = 0


RATIONAL = (0.52, -2.6, 0.0006, -0.0003, 1.5, 0.40, -2.4, 1.4)
DRIVERS = (
    Driver("realsense", "/camera/camera/color/image_raw", "/camera/camera/aligned_depth_to_color/image_raw",
           CameraModel(640, 480, 615.0, 615.2, 322.0, 243.0, "plumb_bob", (0.0,) * 5), "rgb8", "16UC1"),
    Driver("kinect2", "/kinect2/qhd/image_color_rect", "/kinect2/qhd/image_depth_rect",
           CameraModel(960, 540, 540.7, 540.7, 479.7, 269.7, "plumb_bob", (0.05, -0.1, 0.0, 0.0, 0.03)),
           "bgr8", "16UC1", rectified=True),
    Driver("azure_kinect", "/rgb/image_raw", "/depth_to_rgb/image_raw",
           CameraModel(1280, 720, 607.0, 607.1, 638.0, 367.0, "rational_polynomial", RATIONAL), "bgra8", "32FC1"),
    Driver("orbbec", "/camera/color/image_raw", "/camera/depth/image_raw",
           CameraModel(640, 360, 456.0, 456.1, 321.0, 180.5, "rational_polynomial",
                       (0.08, -0.1, 0.0003, -0.0002, 0.04, 0.0, 0.0, 0.0)), "rgb8", "16UC1", padding=64),
)  # fmt: skip


def color_message(driver: Driver, rgb: np.ndarray) -> Image:
    code = {"rgb8": None, "bgr8": cv2.COLOR_RGB2BGR, "bgra8": cv2.COLOR_RGB2BGRA}[driver.color]
    pixels = rgb if code is None else cv2.cvtColor(rgb, code)
    message = messages.image_to_msg(pixels, driver.color)
    if driver.padding:
        rows = np.asarray(message.data, np.uint8).reshape(message.height, message.step)
        message.step += driver.padding
        message.data = np.pad(rows, ((0, 0), (0, driver.padding)), constant_values=255).tobytes()
    return message


def depth_message(driver: Driver, depth: np.ndarray) -> Image:
    if driver.depth == "32FC1":
        return messages.image_to_msg(depth, "32FC1")
    return messages.image_to_msg(np.nan_to_num(np.rint(depth * 1e3), nan=0.0).astype(np.uint16), "16UC1")


@pytest.mark.parametrize("driver", DRIVERS, ids=lambda driver: driver.launch)
def test_a_drivers_messages_become_the_heightmap(driver: Driver, cast_scene, camera_in_base) -> None:
    info = camera_to_msg(driver.lens)
    seen_through = driver.lens
    if driver.rectified:
        p = np.asarray(info.p).reshape(3, 4)
        seen_through = CameraModel(driver.lens.width, driver.lens.height, p[0, 0], p[1, 1], p[0, 2], p[1, 2])
    scene = cast_scene(seen_through, camera_in_base)
    camera = CameraReader(driver.rectified).read(bytes(serialize_message(info)))
    color = decode_color(image_of_raw(bytes(serialize_message(color_message(driver, scene.color)))))
    depth = decode_depth(image_of_raw(bytes(serialize_message(depth_message(driver, scene.depth)))))
    np.testing.assert_array_equal(color, scene.color)
    heightmap = heightmap_from_rgbd(color, depth, camera, camera_in_base, WorkspaceSpec())
    on_cube, on_table = (heightmap.workspace.xy_to_pixel(*xy) for xy in ((0.42, -0.08), (0.5, -0.2)))
    assert heightmap.height[on_cube] == pytest.approx(0.04, abs=0.002)
    assert heightmap.height[on_table] == pytest.approx(0.0, abs=0.002)
    assert tuple(heightmap.color[on_cube]) == (200, 30, 30)


@pytest.mark.parametrize("driver", DRIVERS, ids=lambda driver: driver.launch)
def test_its_launch_file_names_its_topics(driver: Driver) -> None:
    content = yaml.safe_load((LAUNCH / f"{driver.launch}.launch.yaml").read_text())["launch"]
    given = {entry["arg"]["name"]: entry["arg"]["default"] for entry in content if "arg" in entry}
    assert (given["color_image"], given["depth_image"]) == (driver.color_topic, driver.depth_topic)
    assert given["rectified"] == str(driver.rectified).lower()
    known = yaml.safe_load((LAUNCH / "policy.launch.yaml").read_text())["launch"]
    names = {entry["arg"]["name"] for entry in known if "arg" in entry}
    assert set(given) <= names, "an argument that nothing reads"


def test_a_driver_without_a_calibration_is_refused() -> None:
    info = CameraInfo(width=640, height=480, distortion_model="plumb_bob")
    with pytest.raises(CameraModelError, match="is the camera calibrated"):
        CameraReader().read(bytes(serialize_message(info)))
