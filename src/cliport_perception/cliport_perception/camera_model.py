"""A pinhole camera with the distortion models that ROS cameras announce."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception.errors import CameraModelError

# distortion_model of sensor_msgs/CameraInfo -> lengths of D that are understood
DISTORTION_LENGTHS: dict[str, tuple[int, ...]] = {
    "": (0,),
    "none": (0,),
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (8, 12, 14),
}


@dataclass(frozen=True)
class CameraModel:
    """Intrinsics of one camera in pixels, and its lens distortion in OpenCV's order.

    Raises:
        CameraModelError: on impossible intrinsics or an unknown distortion model.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion_model: str = "plumb_bob"
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise CameraModelError(f"image size {self.width}x{self.height} is empty")
        numbers = [self.fx, self.fy, self.cx, self.cy, *self.distortion]
        if not np.all(np.isfinite(numbers)) or self.fx <= 0.0 or self.fy <= 0.0:
            raise CameraModelError(
                f"focal lengths must be positive and finite, got fx={self.fx} fy={self.fy}: is the camera calibrated?"
            )
        lengths = DISTORTION_LENGTHS.get(self.distortion_model)
        if lengths is None:
            raise CameraModelError(
                f"distortion model '{self.distortion_model}' is not supported; "
                f"supported are {', '.join(k for k in DISTORTION_LENGTHS if k)}"
            )
        object.__setattr__(self, "distortion", tuple(float(v) for v in self.distortion))
        if len(self.distortion) not in lengths and any(self.distortion):
            raise CameraModelError(
                f"distortion model '{self.distortion_model}' takes {lengths} coefficients, got {len(self.distortion)}"
            )

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """The camera matrix K (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def is_distorted(self) -> bool:
        """True if any distortion coefficient differs from zero."""
        return any(self.distortion)

    def rays(self) -> npt.NDArray[np.float32]:
        """Return directions (H, W, 3) of the pixel centres in the optical frame, with z = 1; read-only, cached."""
        return self._rays

    @cached_property
    def _rays(self) -> npt.NDArray[np.float32]:
        u: npt.NDArray[np.float64]
        v: npt.NDArray[np.float64]
        u, v = np.meshgrid(np.arange(self.width, dtype=np.float64), np.arange(self.height, dtype=np.float64))
        rays: npt.NDArray[np.float32] = np.ones((self.height, self.width, 3), dtype=np.float32)
        if self.is_distorted:
            pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
            criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-7)
            normal = cv2.undistortPoints(pixels, self.matrix, np.asarray(self.distortion), None, None, None, criteria)
            rays[..., :2] = normal.reshape(self.height, self.width, 2)
        else:
            rays[..., 0] = (u - self.cx) / self.fx
            rays[..., 1] = (v - self.cy) / self.fy
        rays.flags.writeable = False
        return rays

    def project(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return pixels (N, 2) as (row, col), fractional, of points (N, 3) [m] in the optical frame."""
        xyz = np.asarray(points, dtype=np.float64).reshape(-1, 1, 3)
        coefficients = np.asarray(self.distortion) if self.is_distorted else np.zeros(5)
        image, _ = cv2.projectPoints(xyz, np.zeros(3), np.zeros(3), self.matrix, coefficients)
        result: npt.NDArray[np.float64] = image.reshape(-1, 2)[:, ::-1]
        return result
