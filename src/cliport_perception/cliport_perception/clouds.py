"""Organised point clouds in the base frame, laid out as depth_image_proc's xyzrgb."""

from __future__ import annotations

from array import array

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import ImageError
from cliport_perception.pose import Pose

POINT_STEP = 32  # bytes a point: x@0 y@4 z@8 float32, b,g,r,0@16, the rest unused


class CloudBuilder:
    """Clouds of one camera at one pose; rays are computed once.

    camera_in_base: pose of the optical frame (z forward, x right, y down) in the base frame.
    """

    def __init__(self, camera: CameraModel, camera_in_base: Pose) -> None:
        self.camera = camera
        self.camera_in_base = camera_in_base
        rays = camera.rays() @ camera_in_base.rotation.T.astype(np.float32)  # (H, W, 3), base frame
        self._rays = np.ascontiguousarray(np.moveaxis(rays, -1, 0))  # (3, H, W)
        self._origin = camera_in_base.translation.astype(np.float32)

    def build(self, color: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32]) -> array[int]:
        """H * W points of `POINT_STEP` bytes, row by row; xyz is NaN where depth is.

        color: (H, W, 3) RGB; depth_m: (H, W) [m]. The buffer is new and fits a PointCloud2's data as it is.

        Raises:
            ImageError: when an image does not have the camera's size.
        """
        h, w = self.camera.height, self.camera.width
        if depth_m.shape != (h, w) or color.shape != (h, w, 3):
            raise ImageError(f"images are {color.shape} and {depth_m.shape}, the camera model says {(h, w)}")
        buffer = array("B", bytes(h * w * POINT_STEP))
        points = np.frombuffer(buffer, dtype="<f4").reshape(h, w, POINT_STEP // 4)
        for axis in range(3):
            points[..., axis] = depth_m * self._rays[axis] + self._origin[axis]
        bgra = cv2.cvtColor(np.ascontiguousarray(color), cv2.COLOR_RGB2BGRA)
        points.view("<u4")[..., 4] = bgra.view("<u4")[..., 0] & np.uint32(0x00FFFFFF)
        return buffer


def cloud_points(data: memoryview, height: int, width: int) -> npt.NDArray[np.float32]:
    """The xyz (height * width, 3) float32 [m] of a buffer in this layout; NaN where nothing was seen."""
    points = np.frombuffer(data, dtype="<f4").reshape(height * width, POINT_STEP // 4)
    return np.ascontiguousarray(points[:, :3])
