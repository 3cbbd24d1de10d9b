"""Messages in the form of real drivers, under the topics of their launch files, become the right heightmap.

The node hears them as it would the drivers: remapped, with their QoS, from the driver's frames. No driver was run here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
import rclpy
import yaml
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros_until import until
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from cliport_core.compressed_depth import encode_compressed_depth
from cliport_core.heightmap import Heightmap
from cliport_core.image_files import encode_jpeg
from cliport_core.pose import Pose
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_perception import CameraModel
from cliport_perception.conversions import CameraReader, camera_to_msg
from cliport_perception.errors import CameraModelError
from cliport_perception.node import PerceptionNode

LAUNCH = Path(__file__).resolve().parents[3] / "src/cliport_bringup/launch"


class Driver(NamedTuple):
    """What a driver publishes. frame: of its images; padding: bytes after each row of colour."""

    launch: str
    color_topic: str
    depth_topic: str
    frame: str
    lens: CameraModel
    color: str
    depth: str
    rectified: bool = False
    padding: int = 0
    reliable: bool = True


RED = (200, 30, 30)  # the cube
RATIONAL = (0.52, -2.6, 0.0006, -0.0003, 1.5, 0.40, -2.4, 1.4)
DRIVERS = (
    Driver("realsense", "/camera/camera/color/image_raw", "/camera/camera/aligned_depth_to_color/image_raw",
           "camera_color_optical_frame",
           CameraModel(640, 480, 615.0, 615.2, 322.0, 243.0, "plumb_bob", (0.0,) * 5), "rgb8", "16UC1"),
    Driver("kinect2", "/kinect2/qhd/image_color_rect", "/kinect2/qhd/image_depth_rect", "kinect2_rgb_optical_frame",
           CameraModel(960, 540, 540.7, 540.7, 479.7, 269.7, "plumb_bob", (0.05, -0.1, 0.0, 0.0, 0.03)),
           "bgr8", "16UC1", rectified=True),
    Driver("azure_kinect", "/rgb/image_raw", "/depth_to_rgb/image_raw", "rgb_camera_link",
           CameraModel(1280, 720, 607.0, 607.1, 638.0, 367.0, "rational_polynomial", RATIONAL), "bgra8", "32FC1"),
    Driver("orbbec", "/camera/color/image_raw", "/camera/depth/image_raw", "camera_color_optical_frame",
           CameraModel(640, 360, 456.0, 456.1, 321.0, 180.5, "rational_polynomial",
                       (0.08, -0.1, 0.0003, -0.0002, 0.04, 0.0, 0.0, 0.0)),
           "rgb8", "16UC1", padding=64, reliable=False),
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


def seen_through(driver: Driver) -> CameraModel:
    """The lens that its pictures obey: rectified ones that of the projection."""
    if not driver.rectified:
        return driver.lens
    p = np.asarray(camera_to_msg(driver.lens).p).reshape(3, 4)
    return CameraModel(driver.lens.width, driver.lens.height, p[0, 0], p[1, 1], p[0, 2], p[1, 2])


def assert_shows_the_scene(heightmap: Heightmap, red: tuple[int, int, int], within: int) -> None:
    on_cube, on_table = (heightmap.workspace.xy_to_pixel(*xy) for xy in ((0.42, -0.08), (0.5, -0.2)))
    assert heightmap.height[on_cube] == pytest.approx(0.04, abs=0.002)
    assert heightmap.height[on_table] == pytest.approx(0.0, abs=0.002)
    assert np.abs(heightmap.color[on_cube].astype(int) - red).max() <= within


def launched(driver: Driver) -> tuple[dict[str, str], list[str]]:
    """The driver's launch arguments, and the arguments with which perception is then remapped."""
    own, shared = (
        yaml.safe_load((LAUNCH / f"{name}.launch.yaml").read_text())["launch"] for name in (driver.launch, "policy")
    )
    given = {entry["arg"]["name"]: str(entry["arg"]["default"]) for entry in own if "arg" in entry}
    (node,) = (entry["node"] for entry in shared if entry.get("node", {}).get("exec") == "perception")
    remaps = []
    for pair in node["remap"]:
        there = pair["to"]
        for name, value in given.items():
            there = there.replace(f"$(var {name})", value)
        assert "$" not in there
        remaps += ["-r", f"{pair['from']}:={there}"]
    return given, ["--ros-args", *remaps]


class DriverNode:
    """A node that publishes as the driver does, and the frames that its calibration and the driver itself publish."""

    def __init__(self, node: Node, driver: Driver, scene: Any, compressed: bool) -> None:
        self._node, self._driver, self._scene, self._compressed = node, driver, scene, compressed
        given, _ = launched(driver)
        self._root = given["driver_frame"]
        policy = ReliabilityPolicy.RELIABLE if driver.reliable else ReliabilityPolicy.BEST_EFFORT
        qos, kind = QoSProfile(depth=10, reliability=policy), CompressedImage if compressed else Image
        color, depth = ("/compressed", "/compressedDepth") if compressed else ("", "")
        self._color = node.create_publisher(kind, given["color_image"] + color, qos)
        self._depth = node.create_publisher(kind, given["depth_image"] + depth, qos)
        self._info = node.create_publisher(CameraInfo, given["camera_info"], qos)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._ours, self._theirs = (node.create_publisher(TFMessage, "/tf_static", latched) for _ in range(2))

    def place(self) -> None:
        """Base to the root link from the calibration, from there to the images' frame by the driver."""
        in_base, inside = self._scene.camera_in_base, Pose.from_xyz_rpy((0.0, 0.015, 0.0), (-1.5708, 0.0, -1.5708))
        if self._root:
            in_base = in_base @ inside.inverse()
            self._theirs.publish(_link(self._root, self._driver.frame, inside))
        self._ours.publish(_link("panda_link0", self._root or self._driver.frame, in_base))

    def publish(self) -> None:
        color, depth = color_message(self._driver, self._scene.color), depth_message(self._driver, self._scene.depth)
        if self._compressed:
            form, packed = encode_compressed_depth(self._scene.depth, self._driver.depth)
            jpeg = encode_jpeg(self._scene.color, 95)
            color = CompressedImage(format=f"{self._driver.color}; jpeg compressed bgr8", data=jpeg)
            depth = CompressedImage(format=form, data=packed)
        stamp = self._node.get_clock().now().to_msg()
        for publisher, message in (
            (self._info, camera_to_msg(self._driver.lens)), (self._color, color), (self._depth, depth)
        ):  # fmt: skip
            message.header.stamp, message.header.frame_id = stamp, self._driver.frame
            publisher.publish(message)


def _link(parent: str, child: str, pose: Pose) -> TFMessage:
    link = TransformStamped(child_frame_id=child, transform=messages.pose_to_transform_msg(pose))
    link.header.frame_id = parent
    return TFMessage(transforms=[link])


@pytest.fixture
def heard(ros: None, cast_scene, camera_in_base: Pose) -> Iterator[Callable[[Driver, bool], Heightmap]]:
    """What the node makes of a driver's pictures, which come raw or compressed."""
    nodes: list[Node] = []

    def hear(driver: Driver, compressed: bool) -> Heightmap:
        node = rclpy.create_node("driver")
        nodes.append(node)
        settings = {"rectified": driver.rectified, "compressed": compressed}
        perception = PerceptionNode(
            cli_args=launched(driver)[1],
            parameter_overrides=[Parameter(name, value=value) for name, value in settings.items()],
        )
        nodes.append(perception)
        seen: list[HeightmapMsg] = []
        node.create_subscription(HeightmapMsg, topics.HEIGHTMAP, seen.append, 2)
        camera = DriverNode(node, driver, cast_scene(seen_through(driver), camera_in_base), compressed)
        camera.place()
        assert until(nodes, lambda: bool(seen), camera.publish)
        return messages.heightmap_from_msg(seen[-1])

    yield hear
    for node in nodes:
        node.destroy_node()


@pytest.mark.parametrize("driver", DRIVERS, ids=lambda driver: driver.launch)
def test_a_drivers_messages_become_the_heightmap(driver: Driver, heard: Callable[[Driver, bool], Heightmap]) -> None:
    assert_shows_the_scene(heard(driver, False), RED, 0)


def test_a_drivers_compressed_pictures_become_the_heightmap(heard: Callable[[Driver, bool], Heightmap]) -> None:
    assert_shows_the_scene(heard(DRIVERS[0], True), RED, 12)


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
