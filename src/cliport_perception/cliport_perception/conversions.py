"""ROS messages to and from cameras, clouds and diagnostics: pure functions."""

from __future__ import annotations

from array import array

import numpy as np
import numpy.typing as npt
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, PointCloud2, PointField

from cliport_core.errors import ImageError
from cliport_core.messages import stamp_to_msg
from cliport_core.raw_header import CDR_HEAD
from cliport_perception.camera_health import HealthReport
from cliport_perception.camera_model import CameraModel
from cliport_perception.clouds import POINT_STEP

_AFTER_STAMP = CDR_HEAD + 8  # bytes


def camera_to_msg(camera: CameraModel) -> CameraInfo:
    """Return the intrinsics of an unrectified camera; the header is left to the caller."""
    k = camera.matrix
    projection = np.zeros((3, 4))
    projection[:, :3] = k
    message = CameraInfo(width=camera.width, height=camera.height)
    message.distortion_model = camera.distortion_model
    message.d = [float(v) for v in camera.distortion]
    message.k = k.reshape(-1)
    message.r = np.eye(3).reshape(-1)
    message.p = projection.reshape(-1)
    return message


def camera_from_msg(message: CameraInfo, rectified: bool = False) -> CameraModel:
    """Return the camera model of raw images (K, D), or of rectified ones (P, no distortion).

    Raises:
        CameraModelError: on intrinsics that cannot be used.
    """
    m = np.asarray(message.p).reshape(3, 4) if rectified else np.asarray(message.k).reshape(3, 3)
    return CameraModel(
        width=int(message.width),
        height=int(message.height),
        fx=float(m[0, 0]),
        fy=float(m[1, 1]),
        cx=float(m[0, 2]),
        cy=float(m[1, 2]),
        distortion_model="" if rectified else message.distortion_model,
        distortion=() if rectified else tuple(float(v) for v in message.d),
    )


class CameraReader:
    """Reader of serialized CameraInfo messages: it gives the same object as long as only the stamp changes.

    rectified: for images that are rectified already.
    """

    def __init__(self, rectified: bool = False) -> None:
        self._rectified = rectified
        self._last: tuple[bytes, CameraModel] | None = None

    def read(self, raw: bytes) -> CameraModel:
        """Return the camera model of a message. Raises CameraModelError on intrinsics that cannot be used."""
        content = raw[_AFTER_STAMP:]
        if self._last is None or self._last[0] != content:
            self._last = content, camera_from_msg(deserialize_message(raw, CameraInfo), self._rectified)
        return self._last[1]


def cloud_to_msg(data: array[int], frame_id: str, stamp_ns: int) -> PointCloud2:
    """Return a PointCloud2 around a buffer of `CloudBuilder` (not copied)."""
    message = PointCloud2(height=1, width=len(data) // POINT_STEP, point_step=POINT_STEP, row_step=len(data))
    message.header.frame_id = frame_id
    message.header.stamp = stamp_to_msg(stamp_ns)
    layout = (("x", 0), ("y", 4), ("z", 8), ("rgb", 12))
    message.fields = [PointField(name=n, offset=o, datatype=PointField.FLOAT32, count=1) for n, o in layout]
    message.is_dense = True
    message.data = data
    return message


def cloud_points_from_msg(message: PointCloud2) -> npt.NDArray[np.float32]:
    """Return xyz (N, 3) float32 [m] of a cloud of this package or of depth_image_proc, in any little-endian layout.

    Raises:
        ImageError: when x, y and z are not there as float32, or the buffer is too short.
    """
    offsets = {f.name: f.offset for f in message.fields if f.datatype == PointField.FLOAT32 and f.count == 1}
    if message.is_bigendian or not {"x", "y", "z"} <= set(offsets):
        names = ", ".join(f.name for f in message.fields) or "none"
        raise ImageError(f"the point cloud must have x, y and z as little-endian float32; its fields are {names}")
    h, w, step = message.height, message.width, message.point_step
    size = len(message.data)
    if max(offsets[axis] for axis in "xyz") + 4 > step or w * step > message.row_step or size < h * message.row_step:
        raise ImageError(f"a point cloud of {w}x{h} points of {step} bytes does not fit into {size} bytes")
    points: npt.NDArray[np.float32] = np.empty((h, w, 3), dtype=np.float32)
    for axis, name in enumerate("xyz"):
        strides = (message.row_step, step)
        points[..., axis] = np.ndarray((h, w), "<f4", memoryview(message.data), offsets[name], strides) if size else 0
    return points.reshape(-1, 3)


def diagnostics_to_msg(name: str, report: HealthReport, stamp_ns: int) -> DiagnosticArray:
    """Return a report as the status of the camera called `name`."""
    status = DiagnosticStatus(level=bytes([int(report.level)]), name=name, message=report.message)
    status.hardware_id = "camera"
    status.values = [KeyValue(key=key, value=value) for key, value in report.values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message
