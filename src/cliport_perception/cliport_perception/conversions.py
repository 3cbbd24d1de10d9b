"""ROS messages <-> this package's types; pure functions."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Pose as PoseMsg
from geometry_msgs.msg import Transform
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField

from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import WorkspaceSpec as WorkspaceSpecMsg
from cliport_perception.camera_health import HealthReport
from cliport_perception.camera_model import CameraModel
from cliport_perception.clouds import POINT_STEP, cloud_points
from cliport_perception.errors import ImageError
from cliport_perception.heightmap import Heightmap
from cliport_perception.images import ImageBuffer, decode_color, decode_depth
from cliport_perception.pose import Pose
from cliport_perception.workspace import WorkspaceSpec

_NS = 1_000_000_000


def stamp_to_msg(stamp_ns: int) -> Time:
    return Time(sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)


def stamp_from_msg(stamp: Time) -> int:
    return int(stamp.sec) * _NS + int(stamp.nanosec)


def pose_to_msg(pose: Pose) -> PoseMsg:
    message = PoseMsg()
    message.position.x, message.position.y, message.position.z = (float(v) for v in pose.translation)
    x, y, z, w = (float(v) for v in pose.as_quaternion_xyzw())
    message.orientation.x, message.orientation.y = x, y
    message.orientation.z, message.orientation.w = z, w
    return message


def pose_from_msg(message: PoseMsg) -> Pose:
    """Raises ValueError when a number is not finite or the quaternion is zero."""
    p, q = message.position, message.orientation
    return Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (p.x, p.y, p.z))


def pose_to_transform_msg(pose: Pose) -> Transform:
    as_pose = pose_to_msg(pose)
    message = Transform(rotation=as_pose.orientation)
    message.translation.x = as_pose.position.x
    message.translation.y = as_pose.position.y
    message.translation.z = as_pose.position.z
    return message


def pose_from_transform_msg(message: Transform) -> Pose:
    """Raises ValueError when a number is not finite or the quaternion is zero."""
    t, q = message.translation, message.rotation
    return Pose.from_quaternion_xyzw((q.x, q.y, q.z, q.w), (t.x, t.y, t.z))


def workspace_to_msg(workspace: WorkspaceSpec) -> WorkspaceSpecMsg:
    return WorkspaceSpecMsg(**workspace.to_dict())


def workspace_from_msg(message: WorkspaceSpecMsg) -> WorkspaceSpec:
    """Raises WorkspaceError when the numbers make no grid."""
    return WorkspaceSpec.from_dict({name: getattr(message, name) for name in WorkspaceSpec().to_dict()})


def camera_to_msg(camera: CameraModel) -> CameraInfo:
    """Intrinsics of an unrectified camera; the header is left to the caller."""
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
    """The camera model of raw images (K, D), or of rectified ones (P, no distortion).

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


def image_to_msg(pixels: npt.NDArray[Any], encoding: str) -> Image:
    """An Image of (H, W) or (H, W, C) pixels, little-endian; the header is left to the caller."""
    little = np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("<"))
    data = array("B")
    data.frombytes(memoryview(little).cast("B"))
    message = Image(height=pixels.shape[0], width=pixels.shape[1], encoding=encoding, is_bigendian=0)
    message.step = little.nbytes // pixels.shape[0]
    message.data = data
    return message


def color_from_msg(message: Image) -> npt.NDArray[np.uint8]:
    """(H, W, 3) RGB. Raises ImageError, EncodingError."""
    return decode_color(_buffer(message))


def depth_from_msg(message: Image) -> npt.NDArray[np.float32]:
    """(H, W) float32 [m], NaN where unknown. Raises ImageError, EncodingError."""
    return decode_depth(_buffer(message))


def _buffer(message: Image) -> ImageBuffer:
    return ImageBuffer(
        memoryview(message.data),
        message.height,
        message.width,
        message.step,
        message.encoding,
        bool(message.is_bigendian),
    )


def heightmap_to_msg(heightmap: Heightmap, frame_id: str) -> HeightmapMsg:
    message = HeightmapMsg(workspace=workspace_to_msg(heightmap.workspace))
    message.header.frame_id = frame_id
    message.header.stamp = stamp_to_msg(heightmap.stamp_ns)
    message.color = image_to_msg(heightmap.color, "rgb8")
    message.height = image_to_msg(heightmap.height, "32FC1")
    message.valid = image_to_msg(heightmap.valid.astype(np.uint8) * np.uint8(255), "mono8")
    for image in (message.color, message.height, message.valid):
        image.header = message.header
    return message


def heightmap_from_msg(message: HeightmapMsg) -> Heightmap:
    """Raises WorkspaceError, ImageError."""
    workspace = workspace_from_msg(message.workspace)
    expected = (("color", "rgb8", "u1", 3), ("height", "32FC1", "<f4", 1), ("valid", "mono8", "u1", 1))
    arrays = []
    for name, encoding, dtype, channels in expected:
        image = getattr(message, name)
        size = workspace.rows * workspace.cols * channels * np.dtype(dtype).itemsize
        fits = (image.height, image.width) == workspace.shape and len(image.data) == size
        if not fits or image.encoding != encoding or image.is_bigendian:
            raise ImageError(
                f"heightmap {name} must be {workspace.shape} {encoding}, "
                f"got {(image.height, image.width)} {image.encoding} in {len(image.data)} bytes"
            )
        arrays.append(np.frombuffer(image.data, dtype=dtype))
    return Heightmap(
        arrays[0].reshape(*workspace.shape, 3),
        arrays[1].astype(np.float32).reshape(workspace.shape),
        arrays[2].reshape(workspace.shape) > 0,
        workspace,
        stamp_from_msg(message.header.stamp),
    )


def cloud_to_msg(data: array[int], height: int, width: int, frame_id: str, stamp_ns: int) -> PointCloud2:
    """A PointCloud2 around a buffer of `CloudBuilder` (not copied)."""
    message = PointCloud2(height=height, width=width, point_step=POINT_STEP, row_step=POINT_STEP * width)
    message.header.frame_id = frame_id
    message.header.stamp = stamp_to_msg(stamp_ns)
    layout = (("x", 0), ("y", 4), ("z", 8), ("rgb", 16))
    message.fields = [PointField(name=n, offset=o, datatype=PointField.FLOAT32, count=1) for n, o in layout]
    message.is_dense = False
    message.data = data
    return message


def cloud_points_from_msg(message: PointCloud2) -> npt.NDArray[np.float32]:
    """xyz (N, 3) float32 [m] of a cloud in this package's layout. Raises ImageError for other layouts."""
    offsets = {f.name: f.offset for f in message.fields}
    size = message.height * message.width * POINT_STEP
    plain = message.point_step == POINT_STEP and not message.is_bigendian and len(message.data) == size
    if not plain or (offsets.get("x"), offsets.get("y"), offsets.get("z")) != (0, 4, 8):
        raise ImageError("point cloud is not laid out as depth_image_proc's xyzrgb (32 bytes a point)")
    return cloud_points(memoryview(message.data), message.height, message.width)


def diagnostics_to_msg(name: str, report: HealthReport, stamp_ns: int) -> DiagnosticArray:
    status = DiagnosticStatus(level=bytes([int(report.level)]), name=name, message=report.message)
    status.hardware_id = "camera"
    status.values = [KeyValue(key=key, value=value) for key, value in report.values.items()]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp_to_msg(stamp_ns)
    return message
