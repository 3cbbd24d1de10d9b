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
from cliport_core.heap import trim_heap
from cliport_core.pose import Pose
from cliport_core.ros_rgbd import SLOP_S
from cliport_core.ros_running import run_node
from cliport_core.throttle import MessageThrottle
from cliport_core.transforms import TransformTree
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_perception import conversions
from cliport_perception.camera_health import HealthLimits
from cliport_perception.clouds import MARGIN
from cliport_perception.errors import PerceptionError
from cliport_perception.frame_processor import FrameProducts
from cliport_perception.fusion import CameraFusion
from cliport_perception.node_camera import CameraSettings, CameraStream
from cliport_perception.surroundings_watch import MAX_MOTION
from cliport_perception.table_watch import TableLimits
from panda_model.ros_parameters import declare_base_frame, declare_robot

LOG_PERIOD_S = 10.0  # an unchanged fault is logged this often
TRIM_EVERY = 10  # reports: what a large cloud needed at most is given back
PATIENCE = 3  # reports before the first complaint: nodes start in any order


class PerceptionNode(Node):
    """The node: cameras in, what policy and executor need out. Raises CoreError when a parameter is unusable."""

    def __init__(self, **options: Any) -> None:
        """Begin to listen. options: of rclpy's Node."""
        super().__init__("cliport_perception", **options)
        self._base_frame = declare_base_frame(self, declare_robot(self))
        count = self._whole_number("cameras", 1, topics.MOST_CAMERAS)
        limits = HealthLimits.read(self._number)
        settings = self._settings(limits.of_each(count))
        self._reports = 0
        self._transforms = TransformTree()
        self._throttles = [MessageThrottle(LOG_PERIOD_S) for _ in range(count)]

        self._heightmaps = self.create_publisher(HeightmapMsg, topics.HEIGHTMAP, 2)
        self._points = self.create_publisher(PointCloud2, topics.POINTS, 2)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, topics.TF_STATIC, self._on_tf, latched)
        self.create_subscription(TFMessage, topics.TF, self._on_tf, 100)
        self._fusion = CameraFusion(count, limits.max_age_s, limits.min_valid_fraction)
        self._cameras = [
            CameraStream(self, number, settings, self._place, self._serve) for number in range(1, count + 1)
        ]
        # wall time: the report must come even when simulated time stands still
        self.create_timer(1.0, self._report, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _settings(self, limits: HealthLimits) -> CameraSettings:
        path = str(self.declare_parameter("workspace", "").value)
        return CameraSettings(
            workspace=WorkspaceSpec.load(path) if path else WorkspaceSpec(),
            limits=limits,
            heightmap_rate=self._at_least_0("heightmap_rate", 10.0),
            points_rate=self._at_least_0("points_rate", 2.0),
            points_margin=self._at_least_0("points_margin", MARGIN),
            table=self._table_limits(),
            max_picture_motion=self._at_least_0("max_picture_motion", MAX_MOTION),
            depth_frames=self._whole_number("depth_frames", 1),
            rectified=bool(self.declare_parameter("rectified", False).value),
            compressed=bool(self.declare_parameter("compressed", False).value),
            sync_slop=self._at_least_0("sync_slop", SLOP_S),
            decimation=self._whole_number("decimation", 1),
        )

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

    def _whole_number(self, name: str, default: int, most: int | None = None) -> int:
        count = int(self.declare_parameter(name, default).value)
        if count < 1 or (most is not None and count > most):
            wanted = "1 or more" if most is None else f"1 to {most}"
            raise PerceptionError(f"parameter {name} must be {wanted}, got {count}")
        return count

    def _table_limits(self) -> TableLimits | None:
        shift = self._at_least_0("max_table_shift", TableLimits.max_shift)
        tilt = self._at_least_0("max_table_tilt", TableLimits.max_tilt)
        return TableLimits(shift, tilt) if shift > 0.0 and tilt > 0.0 else None

    def _place(self, frame: str) -> Pose:
        return self._transforms.source_in_target(frame, self._base_frame)

    def _on_tf(self, message: TFMessage) -> None:
        for link in message.transforms:
            try:
                pose = messages.pose_from_transform_msg(link.transform)
            except ValueError as error:
                self._complain(f"transform of '{link.child_frame_id}' ignored: {error}")
                continue
            self._transforms.put(link.header.frame_id, link.child_frame_id, pose)

    def _serve(self, number: int, products: FrameProducts) -> None:
        seen = self._fusion.put(number, products)
        if seen is None:
            return
        self._heightmaps.publish(messages.heightmap_to_msg(seen.heightmap, self._base_frame))
        if seen.cloud is not None:
            self._points.publish(conversions.cloud_to_msg(seen.cloud, self._base_frame, seen.cloud_stamp_ns))

    def _report(self) -> None:
        now_ns = self.get_clock().now().nanoseconds
        self._reports += 1
        for camera, throttle in zip(self._cameras, self._throttles, strict=True):
            report = camera.report()
            which = "" if camera.number == 1 else f" {camera.number}"
            if report.level and (camera.has_served or self._reports > PATIENCE):
                words = f"no heightmap: {report.message}" if report.level > 1 else report.message
                self._complain(f"camera{which}: {words}" if which else words, throttle)
            elif not report.level and throttle.reset():
                self.get_logger().info(f"camera{which} data is fresh again")
            self._diagnostics.publish(conversions.diagnostics_to_msg(f"{topics.CAMERA_STATUS}{which}", report, now_ns))
        if self._reports % TRIM_EVERY == 0:
            trim_heap()

    def _complain(self, message: str, throttle: MessageThrottle | None = None) -> None:
        if (throttle or self._throttles[0]).passes(message, time.monotonic()):
            self.get_logger().warning(message)


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run_node(lambda _: PerceptionNode(), (CoreError,), args)
