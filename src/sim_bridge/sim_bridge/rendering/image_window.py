"""A rectangle of an image, for callers who need a part of it only."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cliport_perception import CameraModel, Pose, WorkspaceSpec


@dataclass(frozen=True)
class ImageWindow:
    """Rows [row_start, row_end) and columns [col_start, col_end) of an image."""

    row_start: int
    row_end: int
    col_start: int
    col_end: int

    @classmethod
    def whole(cls, camera: CameraModel) -> ImageWindow:
        """Every pixel."""
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
        """The pixels that see the workspace up to a height `top` [m], and a border of pixels around them."""
        corners = [
            (x, y, z)
            for x in (workspace.x_min, workspace.x_max)
            for y in (workspace.y_min, workspace.y_max)
            for z in (workspace.z_min, top)
        ]
        pixels = camera.project(camera_in_base.inverse().apply(corners))
        low, high = np.min(pixels, axis=0) - border, np.max(pixels, axis=0) + border
        return cls(
            max(0, math.floor(low[0])),
            min(camera.height, math.ceil(high[0])),
            max(0, math.floor(low[1])),
            min(camera.width, math.ceil(high[1])),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        return self.row_end - self.row_start, self.col_end - self.col_start

    @property
    def slices(self) -> tuple[slice, slice]:
        """For indexing an image (H, W, ...)."""
        return slice(self.row_start, self.row_end), slice(self.col_start, self.col_end)
