"""The node `perception`: camera topics in, heightmap, cloud and diagnostics out."""

from __future__ import annotations

import time
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tf2_msgs.msg import TFMessage

from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_perception import conversions
from cliport_perception.adaptive_subscription import AdaptiveSubscription
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.errors import ImageError, PerceptionError
from cliport_perception.frame_processor import FrameProcessor
from cliport_perception.ros_running import run_node
from cliport_perception.sync import ApproximateSync
from cliport_perception.throttle import MessageThrottle
from cliport_perception.transforms import TransformTree
from cliport_perception.workspace import WorkspaceSpec

COLOR = "/camera/color/image_raw"
CAMERA_INFO = "/camera/color/camera_info"
DEPTH = "/camera/aligned_depth_to_color/image_raw"
STATUS_NAME = "cliport_perception: camera"
LOG_PERIOD_S = 10.0  # an unchanged fault is logged this often
PATIENCE = 3  # reports before the first complaint: nodes start in any order


class PerceptionNode(Node):
    """Camera in, what policy and executor need out. Raises PerceptionError when a parameter is unusable."""

    def __init__(self) -> None:
        super().__init__("cliport_perception")
        path = str(self.declare_parameter("workspace", "").value)
        self._base_frame = str(self.declare_parameter("base_frame", "panda_link0").value)
        self._rectified = bool(self.declare_parameter("rectified", False).value)
        limits = HealthLimits(self._number("max_age", 1.0), self._number("min_valid_fraction", 0.05))
        slop_ns = int(self._number("sync_slop", 0.02) * 1e9)
        self._sync: ApproximateSync[Image] = ApproximateSync(("color", "depth"), slop_ns)
        self._reports = 0
        self._transforms = TransformTree()
        self._camera_info: CameraInfo | None = None
        self._throttle = MessageThrottle(LOG_PERIOD_S)

        self._heightmaps = self.create_publisher(HeightmapMsg, "/cliport/heightmap", 2)
        self._points = self.create_publisher(PointCloud2, "/cliport/points", 2)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, "/tf_static", self._on_tf, latched)
        self.create_subscription(TFMessage, "/tf", self._on_tf, 100)
        self._inputs = {
            "color": AdaptiveSubscription(self, Image, COLOR, partial(self._on_image, "color")),
            "depth": AdaptiveSubscription(self, Image, DEPTH, partial(self._on_image, "depth")),
            "camera_info": AdaptiveSubscription(self, CameraInfo, CAMERA_INFO, self._on_camera_info),
        }
        self._health = CameraHealth({name: sub.topic_name for name, sub in self._inputs.items()}, limits)
        self._processor = FrameProcessor(
            WorkspaceSpec.load(path) if path else WorkspaceSpec(),
            self._health,
            self._number("heightmap_rate", 10.0),
            self._number("points_rate", 2.0),
        )
        # wall time: the report must come even when simulated time stands still
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _number(self, name: str, default: float) -> float:
        return float(self.declare_parameter(name, default).value)

    def _on_tf(self, message: TFMessage) -> None:
        for link in message.transforms:
            try:
                pose = conversions.pose_from_transform_msg(link.transform)
            except ValueError as error:
                self._complain(f"transform of '{link.child_frame_id}' ignored: {error}")
                continue
            self._transforms.put(link.header.frame_id, link.child_frame_id, pose)

    def _on_camera_info(self, message: CameraInfo) -> None:
        self._health.on_message("camera_info")
        self._camera_info = message

    def _on_image(self, stream: str, message: Image) -> None:
        self._health.on_message(stream)
        match = self._sync.add(stream, conversions.stamp_from_msg(message.header.stamp), message)
        if match is None or self._camera_info is None:
            return
        try:
            self._serve(match["color"], match["depth"], self._camera_info)
        except PerceptionError as error:
            self._health.on_fault(str(error))

    def _serve(self, color: Image, depth: Image, info: CameraInfo) -> None:
        stamp_ns = conversions.stamp_from_msg(depth.header.stamp)
        if not self._processor.admits(stamp_ns, self.get_clock().now().nanoseconds):
            return
        frame, color_frame = depth.header.frame_id, color.header.frame_id
        if color_frame != frame:
            raise ImageError(f"depth is in frame '{frame}', colour in '{color_frame}': use aligned depth")
        camera = conversions.camera_from_msg(info, self._rectified)
        pose = self._transforms.source_in_target(frame, self._base_frame)
        pixels = conversions.color_from_msg(color), conversions.depth_from_msg(depth)
        products = self._processor.process(*pixels, camera, pose, stamp_ns)
        self._heightmaps.publish(conversions.heightmap_to_msg(products.heightmap, self._base_frame))
        if products.cloud is not None:
            size = camera.height, camera.width
            self._points.publish(conversions.cloud_to_msg(products.cloud, *size, self._base_frame, stamp_ns))

    def _report(self) -> None:
        for subscription in self._inputs.values():
            subscription.adapt()
        now_ns = self.get_clock().now().nanoseconds
        report = self._health.report(now_ns, *self._sync.take_counts())
        self._reports += 1
        if report.level and (self._health.served or self._reports > PATIENCE):
            self._complain(f"no heightmap: {report.message}" if report.level > 1 else report.message)
        elif not report.level and self._throttle.reset():
            self.get_logger().info("camera data is fresh again")
        self._diagnostics.publish(conversions.diagnostics_to_msg(STATUS_NAME, report, now_ns))

    def _complain(self, message: str) -> None:
        if self._throttle.passes(message, time.monotonic()):
            self.get_logger().warning(message)


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    return run_node(lambda _: PerceptionNode(), (PerceptionError,), args)
