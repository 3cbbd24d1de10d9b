"""Camera, transforms and joints -> live views; images stay the bytes they came in until somebody looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image, JointState
from tf2_msgs.msg import TFMessage

from cliport_episodes.observation import CAMERA_TOPIC, COLOR_TOPIC, DEPTH_TOPIC, JOINTS_TOPIC, TF_STATIC_TOPIC
from cliport_episodes.raw import RawMessage
from cliport_perception.adaptive_subscription import AdaptiveSubscription
from cliport_perception.camera_model import CameraModel
from cliport_perception.conversions import pose_from_transform_msg
from cliport_perception.errors import ImageError, PerceptionError
from cliport_perception.raw_header import header_of_raw
from cliport_perception.sync import ApproximateSync
from cliport_perception.throttle import MessageThrottle
from cliport_perception.transforms import TransformTree
from demo_tool.conversions import (
    camera_from_raw,
    color_from_raw,
    depth_from_raw,
    joint_names_from_raw,
    transforms_from_raw,
)
from demo_tool.live_view import LiveView
from demo_tool.station import Station

_SLOP_NS = 20_000_000
_COMPLAINT_PERIOD = 10.0  # [s]
_PATIENCE = 3.0  # before the first complaint is logged: nodes start in any order [s]


class RosCamera:
    """Matches colour and depth by their stamps and hands views to the station."""

    def __init__(self, node: Node, base_frame: str, station: Station, now_ns: Callable[[], int]) -> None:
        self._node, self._base_frame, self._station, self._now_ns = node, base_frame, station, now_ns
        self._sync: ApproximateSync[RawMessage] = ApproximateSync(("color", "depth"), _SLOP_NS)
        self._transforms = TransformTree()
        self._camera: CameraModel | None = None
        self._info: RawMessage | None = None
        self._static: dict[frozenset[str], RawMessage] = {}  # by the frames that a message is about
        self._joints: dict[tuple[str, ...], RawMessage] = {}  # by the joints
        self._throttle = MessageThrottle(_COMPLAINT_PERIOD)
        self._began = time.monotonic()
        self._inputs = [
            AdaptiveSubscription(node, Image, COLOR_TOPIC, partial(self._on_image, "color", COLOR_TOPIC), raw=True),
            AdaptiveSubscription(node, Image, DEPTH_TOPIC, partial(self._on_image, "depth", DEPTH_TOPIC), raw=True),
            AdaptiveSubscription(node, CameraInfo, CAMERA_TOPIC, self._on_camera_info, raw=True),
        ]
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TFMessage, TF_STATIC_TOPIC, self._on_static, latched, raw=True)
        newest = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(JointState, JOINTS_TOPIC, self._on_joints, newest, raw=True)

    def adapt(self) -> None:
        """Look whether the camera's publishers are reliable; call now and then."""
        for subscription in self._inputs:
            subscription.adapt()

    def _on_static(self, raw: bytes) -> None:
        links = transforms_from_raw(raw).transforms
        self._static[frozenset(link.child_frame_id for link in links)] = self._raw(TF_STATIC_TOPIC, TFMessage, raw)
        for link in links:
            try:
                pose = pose_from_transform_msg(link.transform)
            except ValueError as error:
                self._complain(f"the transform of '{link.child_frame_id}' is ignored: {error}")
                continue
            self._transforms.put(link.header.frame_id, link.child_frame_id, pose)

    def _on_joints(self, raw: bytes) -> None:
        self._joints[joint_names_from_raw(raw)] = self._raw(JOINTS_TOPIC, JointState, raw)

    def _on_camera_info(self, raw: bytes) -> None:
        self._info = self._raw(CAMERA_TOPIC, CameraInfo, raw)

    def _on_image(self, stream: str, topic: str, raw: bytes) -> None:
        message = self._raw(topic, Image, raw)
        try:
            match = self._sync.add(stream, header_of_raw(raw)[0], message)
            if match is not None:
                self._station.on_camera(self._view(match["color"], match["depth"]))
        except PerceptionError as error:
            self._complain(str(error))

    def _view(self, color: RawMessage, depth: RawMessage) -> LiveView:
        if self._info is None:
            raise ImageError(f"images come, but nothing on {CAMERA_TOPIC}")
        stamp_ns, frame = header_of_raw(depth.data)
        color_frame = header_of_raw(color.data)[1]
        if color_frame != frame:
            raise ImageError(f"depth is in frame '{frame}', colour in '{color_frame}': use aligned depth")
        camera = camera_from_raw(self._info.data)
        if camera != self._camera:  # the same object as long as it does not change: its rays are kept in it
            self._camera = camera
        assert self._camera is not None
        return LiveView(
            stamp_ns=stamp_ns,
            received_ns=color.stamp_ns,
            frame=frame,
            camera=self._camera,
            camera_in_base=self._transforms.source_in_target(frame, self._base_frame),
            raw=(*self._static.values(), self._info, color, depth, *self._joints.values()),
            read_color=partial(color_from_raw, color.data),
            read_depth=partial(depth_from_raw, depth.data),
        )

    def _raw(self, topic: str, message_type: type, data: bytes) -> RawMessage:
        name = message_type.__module__.split(".")[0] + "/msg/" + message_type.__name__
        return RawMessage(topic, name, data, self._now_ns())

    def _complain(self, line: str) -> None:
        self._station.on_camera_fault(line)
        now = time.monotonic()
        if now - self._began > _PATIENCE and self._throttle.passes(line, now):
            self._node.get_logger().warning(line)
