"""The node with a camera that is a few publishers: served, refused and reported."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from tf2_msgs.msg import TFMessage

from cliport_core import messages
from cliport_core.compressed_depth import encode_compressed_depth
from cliport_core.image_files import encode_jpeg
from cliport_core.pose import Pose
from cliport_core.topics import CAMERA_INFO, COLOR, DEPTH
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_perception import conversions, node
from cliport_perception.clouds import MARGIN
from cliport_perception.errors import PerceptionError
from cliport_perception.heightmap_builder import heightmap_from_rgbd
from cliport_perception.node import PerceptionNode, main

FRAME = "camera_color_optical_frame"


class FakeCamera:
    """Publishes frames as a driver does, and keeps what perception answers."""

    def __init__(self, scene, *parameters: Parameter) -> None:
        self.scene = scene
        self.node = rclpy.create_node("fake_camera")
        self.perception = PerceptionNode(parameter_overrides=list(parameters))
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.perception)
        sensor = qos_profile_sensor_data
        self.color = self.node.create_publisher(Image, COLOR, sensor)
        self.depth = self.node.create_publisher(Image, DEPTH, sensor)
        self.info = self.node.create_publisher(CameraInfo, CAMERA_INFO, sensor)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.tf = self.node.create_publisher(TFMessage, "/tf_static", latched)
        self.heightmaps: list[HeightmapMsg] = []
        self.clouds: list[PointCloud2] = []
        self.reports: list[tuple[int, str]] = []
        self.node.create_subscription(HeightmapMsg, "/cliport/heightmap", self.heightmaps.append, 2)
        self.node.create_subscription(PointCloud2, "/cliport/points", self.clouds.append, 2)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_report, 10)

    def _on_report(self, message: DiagnosticArray) -> None:
        self.reports.append((message.status[0].level[0], message.status[0].message))

    def publish_tf(self) -> None:
        link = TransformStamped(child_frame_id=FRAME)
        link.header.frame_id = "panda_link0"
        link.transform = messages.pose_to_transform_msg(self.scene.camera_in_base)
        self.tf.publish(TFMessage(transforms=[link]))

    def publish(self, depth=None, age_s: float = 0.0, color_encoding: str = "rgb8", frame: str = FRAME) -> int:
        stamp_ns = self.node.get_clock().now().nanoseconds - int(age_s * 1e9)
        depth = self.scene.depth if depth is None else depth
        frames = (
            (self.info, conversions.camera_to_msg(self.scene.camera), frame),
            (self.color, messages.image_to_msg(self.scene.color, color_encoding), frame),
            (self.depth, messages.image_to_msg(depth, "32FC1"), FRAME),
        )
        for publisher, message, frame_id in frames:
            message.header.stamp = messages.stamp_to_msg(stamp_ns)
            message.header.frame_id = frame_id
            publisher.publish(message)
        return stamp_ns

    def until(self, condition: Callable[[], bool], timeout_s: float = 12.0, **frame) -> bool:
        """Publish frames at about 10 Hz until a condition holds."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end and not condition():
            self.publish(**frame)
            pause = time.monotonic() + 0.1
            while time.monotonic() < pause and not condition():
                self.executor.spin_once(timeout_sec=0.02)
        return condition()

    def reported(self, level: int, text: str) -> Callable[[], bool]:
        start = len(self.reports)
        return lambda: any(lv == level and text in message for lv, message in self.reports[start:])


@pytest.fixture
def fake(ros: None, box_scene) -> Iterator[FakeCamera]:
    camera = FakeCamera(box_scene)
    yield camera
    camera.executor.shutdown()
    camera.node.destroy_node()  # its publishers must not be seen by the next test
    camera.perception.destroy_node()


def test_fresh_frames_are_served_once_the_camera_is_placed(fake: FakeCamera) -> None:
    assert fake.until(fake.reported(2, "no transform from 'camera_color_optical_frame' to 'panda_link0'"))
    assert not fake.heightmaps
    fake.publish_tf()
    assert fake.until(lambda: bool(fake.heightmaps and fake.clouds))
    heightmap = messages.heightmap_from_msg(fake.heightmaps[-1])
    assert fake.heightmaps[-1].header.frame_id == fake.clouds[-1].header.frame_id == "panda_link0"
    assert heightmap.height[heightmap.workspace.xy_to_pixel(0.42, -0.08)] == pytest.approx(0.04, abs=0.003)
    points = conversions.cloud_points_from_msg(fake.clouds[-1])
    assert 100_000 < len(points) < 540 * 960 and np.abs(points[:, 1]).max() <= 0.4 + MARGIN
    assert fake.until(fake.reported(0, "camera data is fresh"))


@pytest.mark.parametrize(
    ("fault", "level", "text"),
    [({"age_s": 2.5}, 3, "s old (limit 1.0 s)"),
     ({"depth": lambda depth: depth * np.nan}, 2, "depth is valid in 0.0 %"),
     ({"color_encoding": "yuv422"}, 2, "encoding 'yuv422'; supported are rgb8"),
     ({"frame": "depth_frame"}, 2, "use aligned depth"),
     ({"depth": lambda depth: depth[::2, ::2]}, 2, "depth image is (270, 480), the camera model says (540, 960)"),
     ({"depth": lambda depth: 10.0 * depth}, 2, "depth is about 10 times what this camera, as calibrated, sees"),
     ({"depth": lambda depth: 1e3 * depth}, 2, "m in the median, 100 m at most: is it in millimetres?")],
)  # fmt: skip
def test_unfit_frames_are_reported_and_not_served(fake: FakeCamera, fault: dict, level: int, text: str) -> None:
    if "depth" in fault:
        fault = {"depth": np.ascontiguousarray(fault["depth"](fake.scene.depth), dtype=np.float32)}
    fake.publish_tf()
    assert fake.until(fake.reported(level, text), **fault)
    assert not fake.heightmaps


def test_a_frozen_camera_is_reported_and_recovers(fake: FakeCamera) -> None:
    fake.publish_tf()
    assert fake.until(lambda: bool(fake.heightmaps))
    stale, end = fake.reported(3, "s old"), time.monotonic() + 5.0
    while not stale() and time.monotonic() < end:
        fake.executor.spin_once(timeout_sec=0.05)
    assert stale()
    fake.heightmaps.clear()
    assert fake.until(lambda: bool(fake.heightmaps))


def test_a_camera_that_was_moved_is_reported_and_not_served(fake: FakeCamera, cast_scene) -> None:
    fake.publish_tf()
    assert fake.until(lambda: len(fake.heightmaps) > 6)
    place = fake.scene.camera_in_base
    bumped = Pose(place.rotation, place.translation + np.array([0.0, 0.0, 0.01]))
    moved = cast_scene(fake.scene.camera, bumped).depth
    assert fake.until(fake.reported(2, "the camera was moved: the table lies 10 mm"), depth=moved)
    fake.heightmaps.clear()
    fake.until(lambda: False, timeout_s=1.0, depth=moved)
    assert not fake.heightmaps
    assert fake.until(lambda: bool(fake.heightmaps)), "it was put back"


def test_compressed_images_are_served(fake: FakeCamera) -> None:
    perception = PerceptionNode(parameter_overrides=[Parameter("compressed", value=True)])
    fake.executor.add_node(perception)
    sensor = qos_profile_sensor_data
    color = fake.node.create_publisher(CompressedImage, f"{COLOR}/compressed", sensor)
    depth = fake.node.create_publisher(CompressedImage, f"{DEPTH}/compressedDepth", sensor)
    form, packed = encode_compressed_depth(fake.scene.depth, "16UC1")
    pictures = ((color, "rgb8; jpeg compressed bgr8", encode_jpeg(fake.scene.color, 95)), (depth, form, packed))
    fake.publish_tf()
    seen: list[HeightmapMsg] = []
    fake.node.create_subscription(HeightmapMsg, "/cliport/heightmap", seen.append, 2)
    end = time.monotonic() + 12.0
    while not seen and time.monotonic() < end:
        stamp = fake.node.get_clock().now().to_msg()
        fake.info.publish(conversions.camera_to_msg(fake.scene.camera))
        for publisher, name, data in pictures:
            message = CompressedImage(format=name, data=data)
            message.header.stamp, message.header.frame_id = stamp, FRAME
            publisher.publish(message)
        fake.executor.spin_once(timeout_sec=0.1)
    heightmap = messages.heightmap_from_msg(seen[-1])
    assert heightmap.height[heightmap.workspace.xy_to_pixel(0.42, -0.08)] == pytest.approx(0.04, abs=0.003)
    fake.executor.remove_node(perception)
    perception.destroy_node()


def test_a_missing_workspace_file_ends_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--ros-args", "-p", "workspace:=/nowhere/workspace.yaml"]
    assert main(arguments) == 1
    assert capsys.readouterr().err.strip().startswith("error: cannot read workspace file /nowhere")


def test_a_parameter_of_the_wrong_type_ends_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--ros-args", "-p", "max_age:=soon"]) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("error: ")
    assert "max_age" in error
    assert "\n" not in error


@pytest.mark.parametrize(
    "parameter",
    ["max_age:=.nan", "max_age:=-1.0", "max_table_shift:=.nan", "max_table_tilt:=-0.1", "max_picture_motion:=.nan",
     "sync_slop:=.inf",
     "min_valid_fraction:=1.5", "points_rate:=-2.0", "heightmap_rate:=.nan", "points_margin:=-0.1", "depth_frames:=0"],
)  # fmt: skip
def test_a_parameter_that_cannot_work_ends_in_one_line(parameter: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--ros-args", "-p", parameter]) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("error: ") and parameter.partition(":")[0] in error and "\n" not in error


def test_the_camera_is_heard_as_reliably_as_it_speaks(fake: FakeCamera) -> None:
    fake.publish_tf()
    assert fake.until(lambda: bool(fake.heightmaps))
    inputs = fake.perception._cameras[0]._input.subscriptions
    assert not any(subscription.is_reliable for subscription in inputs.values())
    for name in ("color", "depth", "info"):
        old = getattr(fake, name)
        setattr(fake, name, fake.node.create_publisher(old.msg_type, old.topic_name, 2))
        fake.node.destroy_publisher(old)
    assert fake.until(lambda: all(subscription.is_reliable for subscription in inputs.values()))
    fake.heightmaps.clear()
    assert fake.until(lambda: bool(fake.heightmaps))


def test_memory_is_given_back_now_and_then(fake: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[None] = []
    monkeypatch.setattr(node, "TRIM_EVERY", 2)
    monkeypatch.setattr(node, "trim_heap", lambda: given.append(None))
    fake.publish_tf()
    assert fake.until(lambda: len(given) == 2)


def test_two_cameras_are_joined_and_one_that_falls_silent_is_named(ros: None, box_scene) -> None:
    fake = FakeCamera(box_scene, Parameter("cameras", value=2))
    second = {
        topic: fake.node.create_publisher(kind, topic.replace("/camera/", "/camera2/"), qos_profile_sensor_data)
        for topic, kind in ((CAMERA_INFO, CameraInfo), (COLOR, Image), (DEPTH, Image))
    }
    first, speaks = (fake.info, fake.color, fake.depth), True
    names: list[str] = []
    fake.node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: names.append(m.status[0].name), 10)

    left, right = box_scene.depth.copy(), box_scene.depth.copy()
    left[:, 480:], right[:, :480] = np.nan, np.nan

    def both(**_: object) -> None:
        if speaks:
            fake.info, fake.color, fake.depth = second[CAMERA_INFO], second[COLOR], second[DEPTH]
            FakeCamera.publish(fake, depth=right)
        fake.info, fake.color, fake.depth = first
        FakeCamera.publish(fake, depth=left)

    fake.publish = both  # type: ignore[assignment]
    fake.publish_tf()
    try:
        assert fake.until(lambda: bool(fake.heightmaps and fake.clouds))
        heightmap = messages.heightmap_from_msg(fake.heightmaps[-1])
        alone = heightmap_from_rgbd(
            box_scene.color, left, box_scene.camera, box_scene.camera_in_base, heightmap.workspace
        )
        assert heightmap.valid_fraction > alone.valid_fraction + 0.3
        points = conversions.cloud_points_from_msg(fake.clouds[-1])
        assert min(np.sum(points[:, 1] > 0.05), np.sum(points[:, 1] < -0.05)) > 50_000
        assert fake.until(lambda: "cliport_perception: camera 2" in names and "cliport_perception: camera" in names)
        speaks = False
        assert fake.until(fake.reported(2, "camera 2's newest view is"))
        served = len(fake.heightmaps)
        assert fake.until(fake.reported(3, "newest camera frame is"))
        assert len(fake.heightmaps) == served, "what camera 2 alone sees would be missing"
    finally:
        fake.executor.shutdown()
        fake.node.destroy_node()
        fake.perception.destroy_node()


@pytest.mark.parametrize("count", [0, 10])
def test_an_impossible_number_of_cameras_is_refused(ros: None, count: int) -> None:
    with pytest.raises(PerceptionError, match=f"parameter cameras must be 1 to 9, got {count}"):
        PerceptionNode(parameter_overrides=[Parameter("cameras", value=count)])
