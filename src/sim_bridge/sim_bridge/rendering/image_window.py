"""A rectangle of an image, for callers who need a part of it only."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core import Pose, WorkspaceSpec
from cliport_perception import CameraModel

FloatArray = npt.NDArray[np.float64]


_NEAREST = 0.02  # nearer to the camera's plane than this, a corner's pixel means nothing [m]


@dataclass(frozen=True)
class ImageWindow:
    """Rows [row_start, row_end) and columns [col_start, col_end) of an image."""

    row_start: int
    row_end: int
    col_start: int
    col_end: int

    @classmethod
    def whole(cls, camera: CameraModel) -> ImageWindow:
        """Return the window of every pixel."""
        return cls(0, camera.height, 0, camera.width)

    @classmethod
    def that_sees(
        cls,
        camera: CameraModel,
        camera_in_base: Pose,
        workspace: WorkspaceSpec,
        top: float = 0.12,
        border: int = 12,
    ) -> ImageWindow:
        """Return the pixels that see the workspace up to a height `top` [m], and a border of pixels around them."""
        corners = [
            (x, y, z)
            for x in (workspace.x_min, workspace.x_max)
            for y in (workspace.y_min, workspace.y_max)
            for z in (workspace.z_min, top)
        ]
        in_camera = camera_in_base.inverse().apply(corners)
        if camera.is_distorted or in_camera[:, 2].min() < _NEAREST:
            pixels = _pixels_into_box(camera, camera_in_base, np.array(corners))
        else:
            pixels = camera.project(in_camera)
        if not len(pixels):
            return cls(0, 0, 0, 0)
        low, high = np.min(pixels, axis=0) - border, np.max(pixels, axis=0) + border
        return cls(
            max(0, math.floor(low[0])),
            min(camera.height, math.ceil(high[0])),
            max(0, math.floor(low[1])),
            min(camera.width, math.ceil(high[1])),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Size as (rows, columns)."""
        return self.row_end - self.row_start, self.col_end - self.col_start

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the window in an image (H, W, ...)."""
        return slice(self.row_start, self.row_end), slice(self.col_start, self.col_end)


def _pixels_into_box(camera: CameraModel, camera_in_base: Pose, corners: FloatArray) -> FloatArray:
    """Return the pixels (row, col) whose rays meet the upright box about corners (8, 3) [m, base frame], (N, 2)."""
    origin = camera_in_base.translation
    directions = camera.rays().reshape(-1, 3).astype(np.float64) @ camera_in_base.rotation.T
    directions = np.where(np.abs(directions) < 1e-12, 1e-12, directions)
    ends = np.stack([(bound - origin) / directions for bound in (corners.min(axis=0), corners.max(axis=0))])
    enters, leaves = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    found = np.flatnonzero((leaves >= enters) & (leaves > 0.0))
    return np.column_stack(np.divmod(found, camera.width)).astype(np.float64)
