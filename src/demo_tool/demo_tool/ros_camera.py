"""Live views of camera, transforms and joints; images are decoded only when somebody looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from cliport_core import topics
from cliport_core.messages import pose_from_transform_msg
from cliport_core.ros_compressed import depth_of_raw
from cliport_core.ros_rgbd import RawFrame, RgbdInput
from cliport_core.throttle import MessageThrottle
from cliport_core.transforms import TransformTree
from cliport_episodes.raw import RawMessage
from cliport_perception.calibration.correction_watch import CorrectionWatch
from cliport_perception.conversions import CameraReader
from demo_tool.conversions import (
    COMPRESSED,
    IMAGE,
    color_from_raw,
    joint_names_from_raw,
    joint_positions_from_raw,
    recordable,
    transforms_from_raw,
)
from demo_tool.live_view import LiveView
from demo_tool.station import Station

_CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
_COMPLAINT_PERIOD = 10.0  # [s]
_JOINTS_AGE_NS = 1_000_000_000  # up to which a joint state says where the arm is
_PATIENCE = 3.0  # before the first complaint is logged: nodes start in any order [s]


@dataclass(frozen=True)
class PictureSettings:
    """Form of the camera's pictures: rectified already, compressed; correction: of what their depth measures."""

    rectified: bool = False
    compressed: bool = False
    correction: CorrectionWatch = field(default_factory=lambda: CorrectionWatch(""))


class RosCamera:
    """Subscriptions that give the station the camera's frames as views, with the messages to record.

    pictures: what they are like.
    """

    def __init__(
        self,
        node: Node,
        base_frame: str,
        station: Station,
        now_ns: Callable[[], int],
        pictures: PictureSettings | None = None,
    ) -> None:
        self._node, self._base_frame, self._station, self._now_ns = node, base_frame, station, now_ns
        self._transforms = TransformTree()
        self._pictures = pictures or PictureSettings()
        self._cameras = CameraReader(self._pictures.rectified)
        self._static: dict[frozenset[str], RawMessage] = {}  # by the child frames of a message
        self._joints: dict[tuple[str, ...], RawMessage] = {}  # by the joints of a message
        self._throttle = MessageThrottle(_COMPLAINT_PERIOD)
        self._began = time.monotonic()
        self._input = RgbdInput(node, self._on_frame, self._complain, compressed=self._pictures.compressed)
        names = self._input.topic_names
        station.on_camera_fault(
            f"no picture has come yet: is the camera running? (topics {names['color']} and {names['depth']})"
        )
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TFMessage, topics.TF_STATIC, self._on_static, latched, raw=True)
        newest = QoSProfile(depth=2, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, newest, raw=True)

    def adapt(self) -> None:
        """Match the subscriptions to the reliability of the camera's publishers; to be called every second or so."""
        self._input.adapt()
        self._pictures.correction.poll()

    def joint_positions(self) -> dict[str, float]:
        """Return the newest positions [rad, m] of the joints that were heard of lately, by name."""
        now_ns = self._now_ns()
        states = [state for state in self._joints.values() if abs(now_ns - state.stamp_ns) <= _JOINTS_AGE_NS]
        positions: dict[str, float] = {}
        for state in states:
            positions.update(joint_positions_from_raw(state.data))
        return positions

    def _on_static(self, raw: bytes) -> None:
        links = transforms_from_raw(raw).transforms
        self._static[frozenset(link.child_frame_id for link in links)] = RawMessage(
            topics.TF_STATIC, "tf2_msgs/msg/TFMessage", raw, self._now_ns()
        )
        for link in links:
            try:
                pose = pose_from_transform_msg(link.transform)
            except ValueError as error:
                self._complain(f"the transform of '{link.child_frame_id}' is ignored: {error}")
                continue
            self._transforms.put(link.header.frame_id, link.child_frame_id, pose)

    def _on_joints(self, raw: bytes) -> None:
        self._joints[joint_names_from_raw(raw)] = RawMessage(
            topics.JOINT_STATES, "sensor_msgs/msg/JointState", raw, self._now_ns()
        )

    def _on_frame(self, frame: RawFrame) -> None:
        compressed = self._pictures.compressed
        read_color = partial(color_from_raw, frame.color.data, compressed)
        self._station.on_picture(frame.stamp_ns, read_color)  # also while it is not calibrated
        kind = COMPRESSED if compressed else IMAGE
        messages = (
            RawMessage(topics.CAMERA_INFO, _CAMERA_INFO, *frame.camera_info),
            RawMessage(topics.COLOR, kind, *frame.color),
            RawMessage(topics.DEPTH, kind, *frame.depth),
        )
        view = LiveView(
            stamp_ns=frame.stamp_ns,
            received_ns=frame.color.received_ns,
            frame=frame.frame_id,
            camera=self._cameras.read(frame.camera_info.data),
            camera_in_base=self._transforms.source_in_target(frame.frame_id, self._base_frame),
            raw=(*self._static.values(), *messages, *self._joints.values()),
            read_color=read_color,
            read_depth=partial(depth_of_raw, frame.depth.data, compressed),
            unpack=recordable,
            correction=self._pictures.correction.of_frame(frame.frame_id),
        )
        self._station.on_camera(view)

    def _complain(self, line: str) -> None:
        self._station.on_camera_fault(line)
        now = time.monotonic()
        if now - self._began > _PATIENCE and self._throttle.passes(line, now):
            self._node.get_logger().warning(line)
