"""Compressed pictures in the calibration: its procedures and its check take what perception takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from ros_domain import next_domain
from ros_until import until
from sensor_msgs.msg import CameraInfo, CompressedImage

from cliport_core import messages, topics
from cliport_core.compressed_depth import encode_compressed_depth
from cliport_core.image_files import encode_png
from cliport_core.ros_compressed import color_of_raw, depth_of_raw
from cliport_perception import CameraModel, conversions
from cliport_perception.calibration.procedures import Voice
from cliport_perception.calibration.ros_lens import LensNode
from cliport_perception.calibration.ros_live import LiveCalibration
from cliport_perception.calibration.ros_verify import OneFrame

FRAME = "camera_color_optical_frame"
LENS = CameraModel(64, 48, 50.0, 50.0, 32.0, 24.0)
PICTURE = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)


class Seen(list):
    """A procedure that keeps its pictures and is never complete."""

    is_complete = False

    def on_picture(self, *given: Any) -> None:
        self.append(given[-1])


@pytest.fixture
def ros() -> Iterator[Node]:
    rclpy.init(args=["--ros-args", "-p", "compressed:=true"], domain_id=next_domain())
    node = rclpy.create_node("camera")
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def camera(ros: Node) -> Any:
    """What publishes one compressed frame at each call."""
    form, packed = encode_compressed_depth(np.full((48, 64), 0.9, np.float32), "16UC1")
    color = CompressedImage(format="rgb8; png compressed bgr8", data=encode_png(PICTURE))
    sent = [
        (CompressedImage, f"{topics.COLOR}/compressed", color),
        (CompressedImage, f"{topics.DEPTH}/compressedDepth", CompressedImage(format=form, data=packed)),
        (CameraInfo, topics.CAMERA_INFO, conversions.camera_to_msg(LENS)),
    ]
    publishers = [(ros.create_publisher(kind, name, qos_profile_sensor_data), message) for kind, name, message in sent]

    def show() -> None:
        stamp = messages.stamp_to_msg(ros.get_clock().now().nanoseconds)
        for publisher, message in publishers:
            message.header.frame_id, message.header.stamp = FRAME, stamp
            publisher.publish(message)

    return show


@pytest.mark.parametrize("way", ["board", "lens"])
def test_pictures_reach_both_procedures(ros: Node, way: str) -> None:
    said: list[str] = []
    seen: Any = Seen()
    if way == "lens":
        node: Node = LensNode(seen, Voice(said.append, said.append))
    else:
        node = LiveCalibration(lambda _: seen, ("base", "hand"), said.append)
    assert until([ros, node], lambda: bool(seen), camera(ros))
    np.testing.assert_array_equal(seen[0], PICTURE)
    assert not said
    node.destroy_node()


def test_a_frame_reaches_the_check(ros: Node) -> None:
    node = OneFrame()
    assert until([ros, node], lambda: node.frame is not None, camera(ros))
    assert node.frame is not None and node.compressed
    np.testing.assert_array_equal(color_of_raw(node.frame.color.data, True), PICTURE)
    np.testing.assert_allclose(depth_of_raw(node.frame.depth.data, True), 0.9, atol=1e-3)
    node.destroy_node()
