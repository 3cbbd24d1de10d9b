"""The cameras' view as a grid of columns standing on the table."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cliport_core.workspace import WorkspaceSpec
from panda_executor.reach_map import POOLED_CELLS, ReachMap, pooled, with_common_shadows
from panda_model.limits import FloatArray

AnyFloats = npt.NDArray[np.floating[Any]]
Cells = npt.NDArray[np.int64]

_FINE_STEP = 0.003  # between two sizes of sphere of a fine reach map [m]
BORDER = 0.1  # the grid reaches this far beyond the workspace: the hand is wider than its tcp [m]
EMPTY = -1.0  # height of a column in which nothing was seen [m]
_MIN_POINTS = 2  # a single point in a cell is a flying pixel at an edge, not an object


@dataclass(frozen=True, eq=False)
class ObstacleGrid:
    """Columns from the table up to the highest thing seen: heights (rows, cols) [m], -1 where free.

    Rows run along y, columns along x, as in WorkspaceSpec. What stands in a column is taken to reach down to
    the table: a camera that looks at a slant does not see under things. seen: (rows, cols) cells in which anything was
    seen, the table too; cameras: where that was seen from, (3,) [m, base frame] each; none where that is unknown.
    """

    heights: FloatArray
    x_min: float
    y_min: float
    cell: float
    seen: npt.NDArray[np.bool_] | None = None
    cameras: tuple[FloatArray, ...] = ()
    highest: float = field(init=False)  # of the columns [m]
    _reach: dict[bool, ReachMap] = field(default_factory=dict, init=False, repr=False)  # fine and coarse

    def __post_init__(self) -> None:
        object.__setattr__(self, "highest", float(self.heights.max()))

    def is_below(self, height: float) -> bool:
        """Return True if no column, nor a shadow of one, reaches up to a height [m]."""
        return self.highest <= height

    @classmethod
    def empty(cls, workspace: WorkspaceSpec, cell: float = 0.005) -> ObstacleGrid:
        """Return a grid with nothing on the table."""
        rows = int(np.ceil((workspace.y_max - workspace.y_min + 2 * BORDER) / cell))
        cols = int(np.ceil((workspace.x_max - workspace.x_min + 2 * BORDER) / cell))
        return cls(np.full((rows, cols), EMPTY), workspace.x_min - BORDER, workspace.y_min - BORDER, cell)

    @classmethod
    def from_cloud(
        cls,
        cloud: npt.NDArray[np.float32],
        workspace: WorkspaceSpec,
        floor: float,
        cell: float = 0.005,
        cameras: tuple[FloatArray, ...] = (),
    ) -> ObstacleGrid:
        """Make a grid of points (N, 3) [m, base frame] without the arm's own; those up to `floor` [m] are the table.

        cameras: where they were seen from, (3,) [m, base frame] each, where that is known.
        """
        free = cls.empty(workspace, cell)
        rows, cols = free.heights.shape
        finite = np.isfinite(cloud[:, 2])
        points = cloud if finite.all() else cloud[finite]
        row, col, in_grid = free.cells_at(points[:, 0], points[:, 1])
        inside = np.flatnonzero(in_grid)
        index, z = row[inside] * cols + col[inside], points[inside, 2]
        seen = np.zeros(rows * cols, dtype=bool)
        seen[index] = True
        index, z = index[z > floor], z[z > floor]
        heights = np.full(rows * cols, EMPTY)
        np.maximum.at(heights, index, z.astype(np.float64))
        heights[np.bincount(index, minlength=rows * cols) < _MIN_POINTS] = EMPTY
        shape = rows, cols
        return cls(heights.reshape(shape), free.x_min, free.y_min, cell, seen.reshape(shape), cameras)

    def cells_at(self, x: AnyFloats, y: AnyFloats) -> tuple[Cells, Cells, npt.NDArray[np.bool_]]:
        """Return rows and columns under positions of any shape [m, base frame], and which of them are in the grid."""
        rows, cols = self.heights.shape
        row = np.floor((y - self.y_min) / self.cell).astype(np.int64)
        col = np.floor((x - self.x_min) / self.cell).astype(np.int64)
        return row, col, (row >= 0) & (row < rows) & (col >= 0) & (col < cols)

    def heights_at(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return the column heights under positions of any shape [m, base frame]; free outside the grid."""
        row, col, inside = self.cells_at(x, y)
        found = self.heights[np.where(inside, row, 0), np.where(inside, col, 0)]
        return np.where(inside, found, EMPTY)

    def hits(self, points: FloatArray) -> npt.NDArray[np.bool_]:
        """Return a mask of the points (..., 3) [m, base frame] that lie inside a column."""
        inside: npt.NDArray[np.bool_] = points[..., 2] < self.heights_at(points[..., 0], points[..., 1])
        return inside

    def without(self, points: FloatArray) -> ObstacleGrid:
        """Return the same grid without the columns that hold any of the points (N, 3)."""
        hit = points[self.hits(points)]
        heights = self.heights.copy()
        row, col, _ = self.cells_at(hit[:, 0], hit[:, 1])
        heights[row, col] = EMPTY
        return replace(self, heights=heights)

    def without_near(self, centres: FloatArray, radii: FloatArray) -> ObstacleGrid:
        """Return the same grid without the columns that reach into spheres, centres (N, 3) and radii (N,) [m]."""
        heights = self.heights.copy()
        rows, cols = np.indices(heights.shape)
        x, y = self.x_min + (cols + 0.5) * self.cell, self.y_min + (rows + 0.5) * self.cell
        for centre, radius in zip(centres, radii):
            square = radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2
            underside = centre[2] - np.sqrt(np.maximum(square, 0.0))
            heights[(square > 0.0) & (heights > underside)] = EMPTY
        return replace(self, heights=heights)

    def reach(self, radii: FloatArray, floor: float, shadows: bool, finely: bool = False) -> ReachMap:
        """Return how low spheres of `radii` (N,) [m] may come; made once a grid, and once more finely.

        shadows: whether what no camera could see behind a column counts as filled up to the lowest line of sight;
        finely: to the grid's own cells, for small spheres.
        """
        if finely not in self._reach:
            pool = 1 if finely else POOLED_CELLS
            heights, cell = pooled(self.heights, pool), self.cell * pool
            if shadows and self.cameras and self.seen is not None:
                seen = pooled(self.seen, pool)
                heights = with_common_shadows(heights, seen, self.x_min, self.y_min, cell, self.cameras, floor)
            step = (_FINE_STEP,) if finely else ()
            self._reach[finely] = ReachMap.over(heights, self.x_min, self.y_min, cell, radii, floor, *step)
        return self._reach[finely]
