"""The node `perception`: camera topics in, heightmap, cloud and diagnostics out."""

from __future__ import annotations

import math
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from cliport_core.errors import CoreError
from cliport_core.ros_compressed import color_of_raw, depth_of_raw
from cliport_core.ros_rgbd import SLOP_S, RawFrame, RgbdInput
from cliport_core.ros_running import run_node
from cliport_core.throttle import MessageThrottle
from cliport_core.transforms import TransformTree
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_perception import conversions
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.clouds import MARGIN
from cliport_perception.errors import PerceptionError
from cliport_perception.frame_processor import FrameProcessor
from cliport_perception.table_watch import TableLimits
from panda_model.ros_parameters import declare_base_frame, declare_robot

STATUS_NAME = "cliport_perception: camera"
LOG_PERIOD_S = 10.0  # an unchanged fault is logged this often
PATIENCE = 3  # reports before the first complaint: nodes start in any order


class PerceptionNode(Node):
    """The node: camera in, what policy and executor need out. Raises CoreError when a parameter is unusable."""

    def __init__(self, **options: Any) -> None:
        """Begin to listen. options: of rclpy's Node."""
        super().__init__("cliport_perception", **options)
        path = str(self.declare_parameter("workspace", "").value)
        self._base_frame = declare_base_frame(self, declare_robot(self))
        self._cameras = conversions.CameraReader(bool(self.declare_parameter("rectified", False).value))
        limits = HealthLimits(self._number("max_age", 1.0), self._number("min_valid_fraction", 0.05))
        self._compressed = bool(self.declare_parameter("compressed", False).value)
        self._reports = 0
        self._transforms = TransformTree()
        self._throttle = MessageThrottle(LOG_PERIOD_S)

        self._heightmaps = self.create_publisher(HeightmapMsg, topics.HEIGHTMAP, 2)
        self._points = self.create_publisher(PointCloud2, topics.POINTS, 2)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, topics.TF_STATIC, self._on_tf, latched)
        self.create_subscription(TFMessage, topics.TF, self._on_tf, 100)
        self._camera = RgbdInput(
            self,
            self._serve,
            lambda fault: self._health.on_fault(fault),
            lambda stream: self._health.on_message(stream),
            self._at_least_0("sync_slop", SLOP_S),
            self._compressed,
        )
        self._health = CameraHealth(self._camera.topic_names, limits)
        self._processor = FrameProcessor(
            WorkspaceSpec.load(path) if path else WorkspaceSpec(),
            self._health,
            self._at_least_0("heightmap_rate", 10.0),
            self._at_least_0("points_rate", 2.0),
            self._at_least_0("points_margin", MARGIN),
            self._table_limits(),
            self._depth_frames(),
        )
        # wall time: the report must come even when simulated time stands still
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _number(self, name: str, default: float) -> float:
        value = float(self.declare_parameter(name, default).value)
        if not math.isfinite(value):
            raise PerceptionError(f"parameter {name} must be a finite number, got {value}")
        return value

    def _at_least_0(self, name: str, default: float) -> float:
        value = self._number(name, default)
        if value < 0.0:
            raise PerceptionError(f"parameter {name} must be 0 or more, got {value:g}")
        return value

    def _depth_frames(self) -> int:
        count = int(self.declare_parameter("depth_frames", 1).value)
        if count < 1:
            raise PerceptionError(f"parameter depth_frames must be 1 or more, got {count}")
        return count

    def _table_limits(self) -> TableLimits | None:
        shift = self._at_least_0("max_table_shift", TableLimits.max_shift)
        tilt = self._at_least_0("max_table_tilt", TableLimits.max_tilt)
        return TableLimits(shift, tilt) if shift > 0.0 and tilt > 0.0 else None

    def _on_tf(self, message: TFMessage) -> None:
        for link in message.transforms:
            try:
                pose = messages.pose_from_transform_msg(link.transform)
            except ValueError as error:
                self._complain(f"transform of '{link.child_frame_id}' ignored: {error}")
                continue
            self._transforms.put(link.header.frame_id, link.child_frame_id, pose)

    def _serve(self, frame: RawFrame) -> None:
        stamp_ns = frame.stamp_ns
        if not self._processor.admits(stamp_ns, self.get_clock().now().nanoseconds):
            return
        camera = self._cameras.read(frame.camera_info.data)
        pose = self._transforms.source_in_target(frame.frame_id, self._base_frame)
        color = color_of_raw(frame.color.data, self._compressed)
        depth = depth_of_raw(frame.depth.data, self._compressed)
        products = self._processor.process(color, depth, camera, pose, stamp_ns)
        self._heightmaps.publish(messages.heightmap_to_msg(products.heightmap, self._base_frame))
        if products.cloud is not None:
            self._points.publish(conversions.cloud_to_msg(products.cloud, self._base_frame, stamp_ns))

    def _report(self) -> None:
        self._camera.adapt()
        now_ns = self.get_clock().now().nanoseconds
        matches, drops = self._camera.take_counts()
        report = self._health.report(now_ns, matches, drops)
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
    """Run the node; return the exit status."""
    return run_node(lambda _: PerceptionNode(), (CoreError,), args)
