"""A small square of the cloud, binned on the ground, and the connected part of it that a pixel belongs to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from cliport_core.workspace import WorkspaceSpec
from panda_model.limits import FloatArray

BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int32]

STEP = 0.007  # neighbouring heights that differ more are not one surface; above the noise [m]
LEVEL = 0.0025  # heights that differ less are one level, as far as the noise lets tell [m]
_SQUARE = np.ones((3, 3), dtype=bool)


def points_near(cloud: npt.NDArray[np.float32], x: float, y: float, half: float) -> BoolArray:
    """Return a mask of the points (N, 3) in the square of half edge `half` [m] around (x, y); NaN does not."""
    near: BoolArray = (np.abs(cloud[:, 0] - x) < half) & (np.abs(cloud[:, 1] - y) < half)
    return near


@dataclass(frozen=True, eq=False)
class GroundCells:
    """Cells of the workspace's pixel size around a centre: (n, n), rows along y, columns along x.

    top: highest point [m]; mean: mean height [m]; both NaN where nothing was seen. seen: bool.
    x, y: cell centres [m, base frame].
    """

    top: FloatArray
    mean: FloatArray
    seen: BoolArray
    x: FloatArray
    y: FloatArray
    cell: float

    @classmethod
    def around(
        cls,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        x: float,
        y: float,
        pixels: int,
        z_range: tuple[float, float],
    ) -> GroundCells:
        """Make the square of `pixels` x `pixels` cells centred at (x, y) [m], with points in z_range [m] only."""
        cell = workspace.pixel_size
        half = pixels * cell / 2.0
        near = points_near(cloud, x, y, half)
        near &= (cloud[:, 2] >= z_range[0]) & (cloud[:, 2] <= z_range[1])  # NaN compares false
        points = cloud[near].astype(np.float64)
        row = np.clip(np.floor((points[:, 1] - (y - half)) / cell).astype(np.int64), 0, pixels - 1)
        col = np.clip(np.floor((points[:, 0] - (x - half)) / cell).astype(np.int64), 0, pixels - 1)
        index = row * pixels + col
        count = np.bincount(index, minlength=pixels * pixels)
        top = np.full(pixels * pixels, -np.inf)
        np.maximum.at(top, index, points[:, 2])
        total = np.bincount(index, weights=points[:, 2], minlength=pixels * pixels)
        seen = count > 0
        mean = np.where(seen, total / np.maximum(count, 1), np.nan)
        centres = (np.arange(pixels) + 0.5) * cell - half
        shape = (pixels, pixels)
        grid_y, grid_x = np.meshgrid(y + centres, x + centres, indexing="ij")
        return cls(
            np.where(seen, top, np.nan).reshape(shape),
            mean.reshape(shape),
            seen.reshape(shape),
            grid_x,
            grid_y,
            cell,
        )

    def central(self, pixels: int) -> BoolArray:
        """Return a mask of the central square of `pixels` x `pixels`."""
        mask = np.zeros(self.seen.shape, dtype=bool)
        border = (self.seen.shape[0] - pixels) // 2
        mask[border : border + pixels, border : border + pixels] = True
        return mask

    def parts(self, mask: BoolArray) -> IntArray:
        """Return labels 1.. of the connected parts of `mask`, 0 elsewhere.

        Cells of about the same height count as connected across one or two that were not seen: the cloud is not
        denser than the grid where the camera looks at a slant, and loses edges. A cell that was seen and is not
        in the mask separates.
        """
        labels, _ = ndimage.label(mask | (self._bridges(mask) & ~self.seen), structure=_SQUARE)
        found: IntArray = np.where(mask, labels, 0)
        return found

    def _bridges(self, mask: BoolArray) -> BoolArray:
        """Return the cells between two cells of the mask that are alike in height."""
        top = np.pad(np.where(mask, self.top, np.nan), 2, constant_values=np.nan)
        n, m = mask.shape
        bridges = np.zeros_like(mask)
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            for ahead, behind in ((1, 1), (1, 2), (2, 1)):
                y, x, back_y, back_x = 2 + ahead * dy, 2 + ahead * dx, 2 - behind * dy, 2 - behind * dx
                difference = top[y : y + n, x : x + m] - top[back_y : back_y + n, back_x : back_x + m]
                bridges |= np.abs(difference) < (STEP if ahead == behind else LEVEL)  # NaN compares false
        return bridges

    def component(self, mask: BoolArray, x: float, y: float, reach: float) -> BoolArray | None:
        """Return the part of `mask` with its cell nearest to (x, y) [m], or None beyond `reach` [m]."""
        if not mask.any():
            return None
        distance = np.where(mask, np.hypot(self.x - x, self.y - y), np.inf)
        nearest = np.unravel_index(int(np.argmin(distance)), mask.shape)
        if distance[nearest] > reach:
            return None
        labels = self.parts(mask)
        part: BoolArray = labels == labels[nearest]
        return part
