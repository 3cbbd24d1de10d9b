"""Frames from three topics, with a node that only remembers what is subscribed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rclpy.qos import ReliabilityPolicy
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo

from cliport_core import topics
from cliport_core.errors import ImageError
from cliport_core.messages import image_to_msg, stamp_to_msg
from cliport_core.ros_rgbd import RawFrame, RgbdInput

MS = 1_000_000
TOPICS = [topics.COLOR, topics.DEPTH, topics.CAMERA_INFO]


class FakeNode:
    """The part of a node that subscriptions need; `offered`: what the publishers of each topic offer."""

    def __init__(self) -> None:
        self.offered: dict[str, list[ReliabilityPolicy]] = {}
        self.made: list[tuple[str, ReliabilityPolicy]] = []
        self.destroyed: list[str] = []
        self.callbacks: dict[str, Any] = {}
        self.now_ns = 5

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self.now_ns))

    def create_subscription(self, kind: type, topic: str, callback: Any, profile: Any, raw: bool) -> Any:
        assert raw
        self.made.append((topic, profile.reliability))
        self.callbacks[topic] = callback
        return SimpleNamespace(topic_name=f"/remapped{topic}", topic=topic)

    def destroy_subscription(self, subscription: Any) -> None:
        self.destroyed.append(subscription.topic)

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        offers = self.offered.get(topic, [])
        return [SimpleNamespace(qos_profile=SimpleNamespace(reliability=offer)) for offer in offers]


class Listener:
    def __init__(self) -> None:
        self.node = FakeNode()
        self.frames: list[RawFrame] = []
        self.faults: list[str] = []
        self.heard: list[str] = []
        self.input = RgbdInput(self.node, self.frames.append, self.faults.append, self.heard.append)  # type: ignore[arg-type]

    def send(self, topic: str, stamp_ms: float, frame: str = "camera") -> None:
        message = CameraInfo() if topic == topics.CAMERA_INFO else image_to_msg(np.zeros((2, 2, 3), np.uint8), "rgb8")
        message.header.stamp, message.header.frame_id = stamp_to_msg(round(stamp_ms * MS)), frame
        self.node.callbacks[topic](bytes(serialize_message(message)))


@pytest.fixture
def listener() -> Listener:
    return Listener()


def test_images_of_one_moment_make_a_frame(listener: Listener) -> None:
    listener.send(topics.CAMERA_INFO, 0)
    listener.send(topics.COLOR, 1000)
    listener.node.now_ns = 7
    listener.send(topics.DEPTH, 1020)
    (frame,) = listener.frames
    assert (frame.stamp_ns, frame.frame_id) == (1020 * MS, "camera")
    assert (frame.color.received_ns, frame.depth.received_ns, frame.camera_info.received_ns) == (5, 7, 5)
    assert listener.heard == ["camera_info", "color", "depth"] and not listener.faults
    assert listener.input.take_counts() == (1, 0)
    assert listener.input.take_counts() == (0, 0)


def test_images_farther_apart_do_not(listener: Listener) -> None:
    listener.send(topics.CAMERA_INFO, 0)
    listener.send(topics.COLOR, 1000)
    listener.send(topics.DEPTH, 1020.1)
    assert not listener.frames and not listener.faults


def test_faults_are_one_line(listener: Listener) -> None:
    listener.send(topics.COLOR, 1000)
    listener.send(topics.DEPTH, 1000)
    assert listener.faults == [f"images come, but nothing on /remapped{topics.CAMERA_INFO}"]
    listener.send(topics.CAMERA_INFO, 0)
    listener.send(topics.COLOR, 2000, frame="color")
    listener.send(topics.DEPTH, 2000, frame="depth")
    assert len(listener.faults) == 2
    assert listener.faults[1].startswith("depth is in frame 'depth', colour in 'color': use aligned depth")
    assert not listener.frames


def test_depth_of_its_own_frame_comes_with_its_own_intrinsics() -> None:
    listener = Listener()
    info = "/camera/depth/camera_info"
    listener.input = RgbdInput(
        listener.node,
        listener.frames.append,
        listener.faults.append,
        depth_info=info,  # type: ignore[arg-type]
    )
    listener.send(topics.CAMERA_INFO, 0)
    listener.send(topics.COLOR, 1000, frame="color")
    listener.send(topics.DEPTH, 1000, frame="depth")
    assert listener.faults == [f"images come, but nothing on /remapped{info}"]
    listener.node.now_ns = 9
    listener.send(info, 0, frame="depth")
    listener.send(topics.COLOR, 2000, frame="color")
    listener.send(topics.DEPTH, 2000, frame="depth")
    (frame,) = listener.frames
    assert (frame.frame_id, frame.depth_frame_id) == ("color", "depth")
    assert frame.depth_info is not None and frame.depth_info.received_ns == 9
    listener.send(topics.COLOR, 3000)
    listener.send(topics.DEPTH, 3000)
    aligned = listener.frames[-1]
    assert (aligned.frame_id, aligned.depth_frame_id, aligned.depth_info) == ("camera", "camera", None)


def test_what_the_receiver_refuses_is_a_fault_too() -> None:
    listener = Listener()

    def refuse(frame: RawFrame) -> None:
        raise ImageError("too small")

    listener.input = RgbdInput(listener.node, refuse, listener.faults.append)  # type: ignore[arg-type]
    for topic in (topics.CAMERA_INFO, topics.COLOR, topics.DEPTH):
        listener.send(topic, 0)
    assert listener.faults == ["too small"]


def test_each_subscription_becomes_as_reliable_as_its_publishers(listener: Listener) -> None:
    node, best, reliable = listener.node, ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE
    assert node.made == [(topic, best) for topic in TOPICS]
    assert listener.input.topic_names["depth"] == f"/remapped{topics.DEPTH}"
    listener.input.adapt()  # nobody publishes
    node.offered = {topics.COLOR: [reliable, best], topics.DEPTH: [reliable, reliable]}
    listener.input.adapt()
    assert node.made[3:] == [(topics.DEPTH, reliable)] and node.destroyed == [topics.DEPTH]
    assert [stream for stream, each in listener.input.subscriptions.items() if each.is_reliable] == ["depth"]
    listener.input.adapt()
    node.offered = {}
    listener.input.adapt()
    assert len(node.made) == 4
    node.offered = {topics.DEPTH: [best]}
    listener.input.adapt()
    assert node.made[4:] == [(topics.DEPTH, best)] and not listener.input.subscriptions["depth"].is_reliable
