"""One camera of the perception node: its topics, its judgement, its frames made into heightmaps and clouds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.node import Node

from cliport_core.pose import Pose
from cliport_core.ros_compressed import color_of_raw, depth_of_raw
from cliport_core.ros_rgbd import RawFrame, RgbdInput
from cliport_core.workspace import WorkspaceSpec
from cliport_perception import conversions
from cliport_perception.calibration.correction_watch import CorrectionWatch
from cliport_perception.camera_health import CameraHealth, HealthLimits, HealthReport
from cliport_perception.frame_preparation import FramePreparation
from cliport_perception.frame_processor import FrameProcessor, FrameProducts
from cliport_perception.table_watch import TableLimits

Place = Callable[[str], Pose]  # the pose in the base frame of a frame; raises FrameError
Serve = Callable[[int, FrameProducts], None]  # the camera's number, what its frame gave


@dataclass(frozen=True)
class CameraSettings:
    """Settings that all cameras share; those of `FrameProcessor` and `RgbdInput`, the limits of their judgement."""

    workspace: WorkspaceSpec
    limits: HealthLimits
    heightmap_rate: float
    points_rate: float
    points_margin: float
    table: TableLimits | None
    max_picture_motion: float
    depth_frames: int
    rectified: bool
    compressed: bool
    sync_slop: float
    decimation: int = 1


class CameraStream:
    """Listens to one camera; number: its own, from 1. Whatever is wrong with a frame ends in its report."""

    def __init__(self, node: Node, number: int, settings: CameraSettings, place: Place, serve: Serve) -> None:
        """Begin to listen. Raises CalibrationError when the camera's calibration cannot be used."""
        self.number = number
        own = "" if number == 1 else str(number)  # at the end of parameters of this camera alone
        self._correction = CorrectionWatch(str(node.declare_parameter(f"calibration{own}", "").value))
        depth_info = str(node.declare_parameter(f"depth_camera_info{own}", "").value)
        self._now_ns = lambda: int(node.get_clock().now().nanoseconds)
        self._compressed, self._place, self._serve = settings.compressed, place, serve
        self._models, self._depth_models = (conversions.CameraReader(settings.rectified) for _ in range(2))
        self._preparation = FramePreparation(settings.decimation)
        self._input = RgbdInput(
            node,
            self._on_frame,
            lambda fault: self._health.on_fault(fault),
            lambda stream: self._health.on_message(stream),
            settings.sync_slop,
            settings.compressed,
            number,
            depth_info,
        )
        self._health = CameraHealth(self._input.topic_names, settings.limits)
        self._processor = FrameProcessor(
            settings.workspace,
            self._health,
            settings.heightmap_rate,
            settings.points_rate,
            settings.points_margin,
            settings.table,
            settings.depth_frames,
            settings.max_picture_motion,
        )

    @property
    def has_served(self) -> bool:
        """True once a frame of this camera was good."""
        return self._health.served > 0

    def report(self) -> HealthReport:
        """Return the camera's state; to be called once a second."""
        self._input.adapt()
        self._correction.poll()
        return self._health.report(self._now_ns(), *self._input.take_counts())

    def _on_frame(self, frame: RawFrame) -> None:
        if not self._processor.admits(frame.stamp_ns, self._now_ns()):
            return
        camera = self._models.read(frame.camera_info.data)
        pose = self._place(frame.frame_id)
        color = color_of_raw(frame.color.data, self._compressed)
        depth = depth_of_raw(frame.depth.data, self._compressed)
        if frame.depth_info is None:
            prepared = self._preparation.aligned(color, depth, camera)
        else:
            depth_in_color = pose.inverse() @ self._place(frame.depth_frame_id)
            depth_camera = self._depth_models.read(frame.depth_info.data)
            prepared = self._preparation.unaligned(color, depth, camera, depth_camera, depth_in_color)
        correction = self._correction.of_frame(frame.frame_id)
        self._serve(self.number, self._processor.process(*prepared, pose, frame.stamp_ns, correction))
