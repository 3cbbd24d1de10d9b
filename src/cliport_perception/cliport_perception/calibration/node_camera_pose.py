"""The node `camera_pose`: a calibration file's base → camera on /tf_static, and its age on /diagnostics."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TransformStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from cliport_core.errors import CoreError, FrameError
from cliport_core.ros_running import run_node
from cliport_core.transforms import TransformTree
from cliport_perception import conversions
from cliport_perception.calibration.calibration_watch import CalibrationWatch
from cliport_perception.camera_health import HealthReport, Level
from cliport_perception.errors import CalibrationError

STATUS_NAME = "cliport_perception: calibration"


class CameraPoseNode(Node):
    """Publishes where the camera stands. Raises CalibrationError when the file cannot be used.

    Parameters: `calibration`, the file; `driver_frame`, the camera's root link, where a driver publishes the transforms
    from there to the optical frame; `max_age_days`, after which the calibration is worth a warning.
    """

    def __init__(self, **options: Any) -> None:
        """Publish at once. options: of rclpy's Node."""
        super().__init__("camera_pose", **options)
        path = str(self.declare_parameter("calibration", "").value)
        self._driver_frame = str(self.declare_parameter("driver_frame", "").value)
        max_age_days = float(self.declare_parameter("max_age_days", 30.0).value)
        if not path:
            raise CalibrationError("no calibration given: -p calibration:=calibration/camera.yaml")
        self._watch = CalibrationWatch(Path(path), max_age_days, lambda: datetime.now(timezone.utc))
        self._tree = TransformTree()
        self._camera_ns: int | None = None
        self._published: tuple[str, str] | None = None
        self._is_joined = False
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._transforms = self.create_publisher(TFMessage, topics.TF_STATIC, latched)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        self.create_subscription(CameraInfo, topics.CAMERA_INFO, self._on_camera, qos_profile_sensor_data)
        if self._driver_frame:
            many = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self.create_subscription(TFMessage, topics.TF_STATIC, self._on_tf, many)
        self.create_timer(1.0, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._publish()

    def _publish(self) -> None:
        record = self._watch.record
        pose, child = record.camera.camera_in_base, record.camera_frame
        if self._driver_frame:
            try:
                pose = pose @ self._tree.source_in_target(self._driver_frame, child)
            except FrameError:
                self._is_joined = False  # the driver has not said yet
                return
            child = self._driver_frame
        link = TransformStamped(child_frame_id=child, transform=messages.pose_to_transform_msg(pose))
        link.header.frame_id = record.base_frame
        link.header.stamp = self.get_clock().now().to_msg()
        self._transforms.publish(TFMessage(transforms=[link]))
        self._published = record.base_frame, child
        self._is_joined = True
        self.get_logger().info(f"{child} in {record.base_frame}: {record.method.value}, {pose.translation.round(4)} m")

    def _on_tf(self, message: TFMessage) -> None:
        for link in message.transforms:
            if (link.header.frame_id, link.child_frame_id) == self._published:
                continue
            try:
                pose = messages.pose_from_transform_msg(link.transform)
            except ValueError as error:
                self.get_logger().warning(f"transform of '{link.child_frame_id}' ignored: {error}")
                continue
            self._tree.put(link.header.frame_id, link.child_frame_id, pose)
        if not self._is_joined:
            self._publish()

    def _on_camera(self, message: CameraInfo) -> None:
        self._camera_ns = messages.stamp_from_msg(message.header.stamp)

    def _tick(self) -> None:
        now_ns = self.get_clock().now().nanoseconds
        if self._watch.poll() is not None:
            self._publish()
        age = None if self._camera_ns is None else (now_ns - self._camera_ns) * 1e-9
        report = self._watch.report(age)
        if not self._is_joined:
            words = (
                f"nothing published: no transform from '{self._watch.record.camera_frame}' to driver_frame "
                f"'{self._driver_frame}' on {topics.TF_STATIC}: is the driver running, is the name right?"
            )
            report = HealthReport(Level.ERROR, words, report.values)
        self._diagnostics.publish(conversions.diagnostics_to_msg(STATUS_NAME, report, now_ns))


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run_node(lambda _: CameraPoseNode(), (CoreError,), args)
