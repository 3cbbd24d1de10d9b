"""Depth of one camera drawn into the image of another beside it: each pixel over what it covers, the nearest wins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError
from cliport_core.pose import Pose
from cliport_perception.camera_model import CameraModel
from cliport_perception.heightmap_builder import MAX_DEPTH_STEP

FloatImage = npt.NDArray[np.float32]

_SEAM = 0.3  # by which a pixel reaches beyond its own patch, so that slanted surfaces have no seams [px]
_MOST_COVERED = 8  # pixels along each side that one pixel of depth may cover
_BEYOND = 0.1  # how far outside the colour's picture a ray may be projected, where the lens is still what it is


class _Patch(NamedTuple):
    """Patches (N,) of the picture that pixels of depth cover: first and last column and row, fractional [px]."""

    left: FloatImage
    right: FloatImage
    top: FloatImage
    bottom: FloatImage


class DepthRegistration:
    """Drawing of a depth camera's images as the colour camera would measure them.

    depth_in_color: pose of the depth camera's optical frame in the colour camera's. What only one of them sees stays
    unknown, and so does what the depth camera does not measure: nothing is filled in.
    """

    def __init__(self, depth_camera: CameraModel, color_camera: CameraModel, depth_in_color: Pose) -> None:
        self.depth_camera, self.color_camera, self.depth_in_color = depth_camera, color_camera, depth_in_color
        rays = depth_camera.rays().reshape(-1, 3) @ depth_in_color.rotation.T.astype(np.float32)
        self._rays = np.ascontiguousarray(rays.T)  # (3, h * w), in the colour's frame
        self._shift = depth_in_color.translation.astype(np.float32)[:, None]
        seen = color_camera.rays()[..., :2].reshape(-1, 2)
        self._lowest, self._highest = seen.min(axis=0) - _BEYOND, seen.max(axis=0) + _BEYOND

    def register(self, depth_m: FloatImage) -> FloatImage:
        """Return depth (H, W) [m] in the colour camera's image of depth_m (h, w) [m], both NaN where unknown.

        Raises:
            ImageError: when depth_m does not have the depth camera's size.
        """
        size = (self.depth_camera.height, self.depth_camera.width)
        if depth_m.shape != size:
            raise ImageError(f"depth image is {depth_m.shape}, its camera_info says {size} (rows, columns)")
        points, depth = self._points(depth_m)
        patch, there = self._patches(points, depth), points[2]
        nearest = self._drawn(patch, there, _SEAM, None)
        own = self._drawn(patch, there, 0.0, nearest + np.float32(MAX_DEPTH_STEP))
        drawn = np.where(np.isfinite(own), own, nearest)
        drawn[~np.isfinite(drawn)] = np.nan
        result: FloatImage = drawn.reshape(self.color_camera.height, self.color_camera.width)
        return result

    def _points(self, depth_m: FloatImage) -> tuple[FloatImage, FloatImage]:
        """Return points (3, N) in the colour's frame that it may see, and their depth (N,) as it was measured."""
        depth = depth_m.ravel()
        with np.errstate(divide="ignore", invalid="ignore"):
            points = self._rays * np.where(depth > 0.0, depth, np.nan) + self._shift
            x, y = points[0] / points[2], points[1] / points[2]
        seen = (points[2] > 0.0) & (x > self._lowest[0]) & (x < self._highest[0])  # NaN compares false
        seen &= (y > self._lowest[1]) & (y < self._highest[1])
        at = np.flatnonzero(seen)
        return points.take(at, axis=1), depth.take(at)

    def _patches(self, points: FloatImage, depth: FloatImage) -> _Patch:
        """Return what the pixels of points (3, N) cover, whose own depth is depth (N,)."""
        color, sensor = self.color_camera, self.depth_camera
        if color.is_distorted and depth.size:
            row, col = color.project(points.T).astype(np.float32).T
        else:
            row, col = points[1] / points[2] * color.fy + color.cy, points[0] / points[2] * color.fx + color.cx
        across = np.float32(color.fx / sensor.fx / 2.0) * depth / points[2]
        along = np.float32(color.fy / sensor.fy / 2.0) * depth / points[2]
        return _Patch(col - across, col + across, row - along, row + along)

    def _drawn(self, patch: _Patch, depth: FloatImage, seam: float, most: FloatImage | None) -> FloatImage:
        """Return the least depth (H * W,) in each pixel, infinite where there is none; most: deeper ones are left out.

        seam: by which patches are larger than what they cover [px].
        """
        height, width = self.color_camera.height, self.color_camera.width
        left, top = (np.ceil(side - seam).astype(np.intp) for side in (patch.left, patch.top))
        columns = np.minimum(np.ceil(patch.right + seam).astype(np.intp) - left, _MOST_COVERED)
        rows = np.minimum(np.ceil(patch.bottom + seam).astype(np.intp) - top, _MOST_COVERED)
        drawn: FloatImage = np.full(height * width, np.inf, dtype=np.float32)
        for down in range(int(rows.max(initial=0))):
            for right in range(int(columns.max(initial=0))):
                row, col = top + down, left + right
                inside = (down < rows) & (right < columns) & (row >= 0) & (row < height) & (col >= 0) & (col < width)
                at, value = (row * width + col)[inside], depth[inside]
                if most is not None:
                    near = value <= most[at]
                    at, value = at[near], value[near]
                np.minimum.at(drawn, at, value)
        return drawn
