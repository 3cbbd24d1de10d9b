"""Heights down to which spheres may come over the columns of a grid: one look-up a sphere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from panda_model.limits import FloatArray

Number = TypeVar("Number", bound=np.generic)
BoolArray = npt.NDArray[np.bool_]

_POOL = 2  # cells of the grid along the edge of one of a coarse map
_CLASS_STEP = 0.008  # between two sizes of sphere [m]
_FREE = -10.0  # height of what no sphere touches [m]
_SHADOW_LENGTH = 0.6  # at most [m]


@dataclass(frozen=True, eq=False)
class ReachMap:
    """Heights (K, rows, cols) [m]: a sphere of size k whose centre is below them touches a column.

    cell: edge [m]; x_min, y_min: corner [m, base frame]; sizes: (K,) radii [m]; highest: of the columns [m].
    """

    tops: FloatArray
    x_min: float
    y_min: float
    cell: float
    sizes: FloatArray
    highest: float

    @classmethod
    def over(
        cls,
        heights: FloatArray,
        x_min: float,
        y_min: float,
        cell: float,
        radii: FloatArray,
        floor: float,
        class_step: float = _CLASS_STEP,
    ) -> ReachMap:
        """Make the map for spheres of `radii` (N,) [m] over columns (rows, cols) [m]; those up to `floor` are free.

        class_step: between two sizes of sphere [m].
        """
        sizes = np.arange(float(radii.min()), float(radii.max()) + class_step, class_step)
        occupied = heights > floor
        highest = float(heights[occupied].max()) if occupied.any() else _FREE
        columns = np.where(occupied, heights, _FREE)
        tops = np.full((len(sizes), *heights.shape), _FREE)
        if occupied.any():
            tops = np.stack([_raised(columns, float(size), cell) for size in sizes])
        return cls(tops, x_min, y_min, cell, sizes, highest)

    def classes(self, radii: FloatArray) -> npt.NDArray[np.int64]:
        """Return the number of the smallest size that is as large as each of the radii (N,) [m]."""
        return np.searchsorted(self.sizes, radii - 1e-9)

    def hits(self, centres: FloatArray, radii: FloatArray) -> BoolArray:
        """Return a mask of the spheres, centres (N, 3) [m, base frame], that touch a column; free outside the map."""
        found = np.zeros(len(centres), dtype=bool)
        low = centres[:, 2] - radii < self.highest
        if not low.any():
            return found
        rows, cols = self.tops.shape[1:]
        row = np.floor((centres[:, 1] - self.y_min) / self.cell).astype(np.int64)
        col = np.floor((centres[:, 0] - self.x_min) / self.cell).astype(np.int64)
        inside = low & (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
        which = self.classes(radii[inside])
        found[inside] = centres[inside, 2] < self.tops[which, row[inside], col[inside]]
        return found


def pooled(values: npt.NDArray[Number], pool: int = _POOL) -> npt.NDArray[Number]:
    """Return the largest value of each `pool` x `pool` cells of (rows, cols); a remainder is filled by its edge."""
    rows, cols = values.shape
    padded = np.pad(values, ((0, -rows % pool), (0, -cols % pool)), mode="edge")
    blocks = padded.reshape(padded.shape[0] // pool, pool, padded.shape[1] // pool, pool)
    return np.asarray(blocks.max(axis=(1, 3)))


POOLED_CELLS = _POOL


def with_shadows(
    heights: FloatArray, seen: BoolArray, x_min: float, y_min: float, cell: float, camera: FloatArray, floor: float
) -> FloatArray:
    """Return columns (rows, cols) [m] with unseen cells behind a column filled up to the camera's line of sight.

    seen: cells in which the camera saw anything, the table too; camera: position (3,) [m, base frame].
    """
    row, col = np.nonzero(heights > floor)
    top = heights[row, col]
    below = top < camera[2] - cell
    row, col, top = row[below], col[below], top[below]
    x, y = x_min + (col + 0.5) * cell, y_min + (row + 0.5) * cell
    away = np.stack([x - camera[0], y - camera[1]], axis=-1)
    distance = np.maximum(np.linalg.norm(away, axis=1), cell)
    step = away / distance[:, None] * cell
    drop = cell * (camera[2] - top) / distance
    filled = heights.copy()
    for k in range(1, round(_SHADOW_LENGTH / cell)):
        line = top - k * drop
        i = np.floor((y + k * step[:, 1] - y_min) / cell).astype(np.int64)
        j = np.floor((x + k * step[:, 0] - x_min) / cell).astype(np.int64)
        inside = (line > floor) & (i >= 0) & (i < heights.shape[0]) & (j >= 0) & (j < heights.shape[1])
        if not inside.any():
            break
        i, j, line = i[inside], j[inside], line[inside]
        hidden = ~seen[i, j]
        np.maximum.at(filled, (i[hidden], j[hidden]), line[hidden])
    return filled


def with_common_shadows(
    heights: FloatArray,
    seen: BoolArray,
    x_min: float,
    y_min: float,
    cell: float,
    cameras: tuple[FloatArray, ...],
    floor: float,
) -> FloatArray:
    """Return columns as `with_shadows` does for what is hidden from every camera: up to the lowest line of sight.

    seen: cells in which any camera saw anything. Every camera's picture is taken to cover the columns.
    """
    views = [with_shadows(heights, seen, x_min, y_min, cell, camera, floor) for camera in cameras]
    return np.asarray(np.min(views, axis=0))


def _raised(columns: FloatArray, radius: float, cell: float) -> FloatArray:
    """Return the height below which a sphere's centre touches a column, for every cell it may be in."""
    n = int(np.ceil(radius / cell)) + 1
    steps = np.maximum(np.abs(np.arange(-n, n + 1)) - 1, 0) * cell  # the least distance between points of two cells
    square = radius**2 - (steps[:, None] ** 2 + steps[None, :] ** 2)
    footprint = square >= 0.0
    lift = np.sqrt(np.maximum(square, 0.0))
    raised: FloatArray = ndimage.grey_dilation(
        columns, footprint=footprint, structure=lift, mode="constant", cval=_FREE
    )
    return raised
