"""Point clouds in the base frame, of what lies over and around the workspace."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_model import CameraModel
from cliport_perception.scratch import Scratch

POINT_STEP = 16  # bytes a point: x@0 y@4 z@8 float32, b,g,r,0@12
_POINT = np.complex128  # any type of as many bytes
MARGIN = 0.3  # how far beyond the workspace points are kept: the executor asks for 0.12, viewers like more [m]


@dataclass(frozen=True)
class CloudRegion:
    """The area in which points are kept: x_min..x_max, y_min..y_max [m, base frame], the upper bounds excluded.

    It is open upwards and downwards.
    """

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    @classmethod
    def around(cls, workspace: WorkspaceSpec, margin: float = MARGIN) -> CloudRegion:
        """Return the workspace's area with `margin` [m] more on every side."""
        return cls(
            workspace.x_min - margin, workspace.x_max + margin, workspace.y_min - margin, workspace.y_max + margin
        )


class CloudBuilder:
    """Maker of clouds from one camera at one pose; rays are computed once.

    camera_in_base: pose of the optical frame (z forward, x right, y down) in the base frame.
    """

    def __init__(self, camera: CameraModel, camera_in_base: Pose, region: CloudRegion) -> None:
        self.camera = camera
        self.camera_in_base = camera_in_base
        self.region = region
        rays = camera.rays() @ camera_in_base.rotation.T.astype(np.float32)  # (H, W, 3), base frame
        self._rays = np.ascontiguousarray(np.moveaxis(rays, -1, 0))  # (3, H, W)
        self._scratch = Scratch()
        self._origin = camera_in_base.translation.astype(np.float32)

    def points(self, depth_m: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Return points (N, 3) float32 [m] of depth_m (H, W) [m], row by row; those outside the region are left out.

        Raises:
            ImageError: when the image does not have the camera's size.
        """
        planes, inside = self._planes(depth_m)
        return np.stack([plane[inside] for plane in planes], axis=-1)

    def build(self, color: npt.NDArray[np.uint8], depth_m: npt.NDArray[np.float32]) -> array[int]:
        """Return the same points in colour, `POINT_STEP` bytes each, in a new buffer as PointCloud2's data has it.

        color: (H, W, 3) RGB; depth_m: (H, W) [m], NaN where unknown.

        Raises:
            ImageError: when an image does not have the camera's size.
        """
        if color.shape != (*self._size, 3):
            raise ImageError(f"colour image is {color.shape}, the camera model says {(*self._size, 3)}")
        planes, inside = self._planes(depth_m)
        four = self._scratch.array("bgra", (*self._size, 4), np.uint8)
        bgra = cv2.cvtColor(np.ascontiguousarray(color), cv2.COLOR_RGB2BGRA, four).view("<i4")[..., 0]
        bgra &= 0x00FFFFFF
        x, y, z = (plane.view("<i4") for plane in planes)
        pixels = cv2.merge([x, y, z, bgra], self._scratch.array("pixels", (*self._size, 4), np.int32))
        # One item a point, picked as a whole and by number: much faster than number by number, or by a mask.
        kept = np.flatnonzero(inside)
        buffer = array("B", [0]) * (POINT_STEP * len(kept))
        if len(kept):  # straight into the buffer; the numbers are in range, and "raise" would copy
            pixels.view(_POINT).ravel().take(kept, out=np.frombuffer(buffer, _POINT), mode="clip")
        return buffer

    @property
    def _size(self) -> tuple[int, int]:
        return self.camera.height, self.camera.width

    def _planes(
        self, depth_m: npt.NDArray[np.float32]
    ) -> tuple[tuple[npt.NDArray[np.float32], ...], npt.NDArray[np.bool_]]:
        """Return x, y and z (H, W) [m] of every pixel, and a mask (H, W) of the pixels inside the region."""
        if depth_m.shape != self._size:
            raise ImageError(f"depth image is {depth_m.shape}, the camera model says {self._size}")
        region = self.region
        planes = self._scratch.array("planes", self._rays.shape, np.float32)
        for plane, ray, start in zip(planes, self._rays, self._origin, strict=True):
            np.multiply(depth_m, ray, out=plane)
            plane += start
        x, y, z = planes
        inside = (x >= region.x_min) & (x < region.x_max)  # NaN compares false
        inside &= (y >= region.y_min) & (y < region.y_max)
        return (x, y, z), inside
