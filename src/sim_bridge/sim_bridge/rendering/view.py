"""Part of an image that bodies and their shadows can take: no ray need be cast where they cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from cliport_perception import CameraModel
from sim_bridge.rendering.image_window import ImageWindow

_NEAREST = 0.02  # nearer to the camera's plane than this, outlines mean nothing [m]
_SUBPIXEL_BITS = 4


@dataclass(frozen=True, eq=False)
class View:
    """A window of a camera's image, and the pose of its optical frame."""

    camera: CameraModel
    window: ImageWindow
    camera_in_base: Pose

    def silhouettes(self, bodies: Sequence[npt.NDArray[np.float32]]) -> npt.NDArray[np.bool_]:
        """Return (H, W) pixels that may show the convex hull of any body's
        points (K, 3) [m], and a border of one pixel.

        All pixels, where outlines are not to be had: a body reaches behind the camera, or the lens distorts.
        """
        mask = np.zeros(self.window.shape, dtype=np.uint8)
        if not bodies:
            return mask.view(np.bool_)
        pixels = self._pixels(np.concatenate(bodies))
        if not np.isfinite(pixels).all():
            return ~mask.view(np.bool_)
        corners = np.rint(pixels * (1 << _SUBPIXEL_BITS)).astype(np.int32)
        for outline in np.split(corners, np.cumsum([len(body) for body in bodies[:-1]])):
            cv2.fillConvexPoly(mask, cv2.convexHull(outline), 1, shift=_SUBPIXEL_BITS)
        return cv2.dilate(mask, np.ones((3, 3), dtype=np.uint8)).view(np.bool_)

    def may_see(self, bodies: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        """Return (B,) whether the convex hull of a body's points, (B, K, 3) [m], can reach into the image."""
        pixels = self._pixels(bodies.reshape(-1, 3)).reshape(*bodies.shape[:2], 2)
        high, low = pixels.max(axis=1), pixels.min(axis=1)
        outside = (high < -1.0).any(axis=1) | (low > self.window.shape[::-1]).any(axis=1)
        return ~outside  # comparisons with NaN are false

    def _pixels(self, points: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
        """Return (column, row) in the window (N, 2); NaN for points that have no useful place in the image."""
        in_camera = self.camera_in_base.inverse().apply(points)
        depth = in_camera[:, 2:]
        useful = (depth > _NEAREST) & (not self.camera.is_distorted)
        camera, window = self.camera, self.window
        slopes = in_camera[:, :2] / np.where(useful, depth, np.nan)
        return slopes * (camera.fx, camera.fy) + (camera.cx - window.col_start, camera.cy - window.row_start)


def along_light(
    points: npt.NDArray[np.float32], to_light: npt.NDArray[np.float32], height: float
) -> npt.NDArray[np.float32]:
    """Return the shadows of points (..., 3) on a level plane at a height [m]."""
    return points - (points[..., 2:] - np.float32(height)) * (to_light / to_light[2])
