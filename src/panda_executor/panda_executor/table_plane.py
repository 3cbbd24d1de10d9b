"""The table's plane, as the cloud shows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core.workspace import WorkspaceSpec
from panda_model import FloatArray


@dataclass(frozen=True)
class TableConfig:
    """Settings of the look for the table, lengths in m.

    tolerance: how far it may be from its configured height anywhere in the workspace; reach: within which it is looked
    for; band: of its own points about the plane; level_share: of the fullest level's points that a lower one needs to
    be the table; min_points: fewer are no table.
    """

    tolerance: float = 0.003
    reach: float = 0.03
    band: float = 0.005
    level_share: float = 0.3
    min_points: int = 300


@dataclass(frozen=True)
class TablePlane:
    """Height [m] at the workspace's middle (x, y) [m], and its slopes along x and y."""

    height: float
    slope_x: float
    slope_y: float
    x: float
    y: float

    def height_at(self, x: float, y: float) -> float:
        """Return the height [m] at a place [m, base frame]."""
        return self.height + self.slope_x * (x - self.x) + self.slope_y * (y - self.y)

    def worst(self, workspace: WorkspaceSpec, table_z: float) -> float:
        """Return the largest difference [m] from a level table at `table_z` in the workspace's corners, signed."""
        corners = [(x, y) for x in (workspace.x_min, workspace.x_max) for y in (workspace.y_min, workspace.y_max)]
        return max((self.height_at(x, y) - table_z for x, y in corners), key=abs)


def measure_table(
    cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec, table_z: float, config: TableConfig | None = None
) -> TablePlane | None:
    """Return the plane of the cloud's (N, 3) [m, base frame] lowest large level, or None where too little is seen."""
    config = config or TableConfig()
    x, y, z = (cloud[:, axis] for axis in range(3))
    near = (x > workspace.x_min) & (x < workspace.x_max) & (y > workspace.y_min) & (y < workspace.y_max)
    near &= np.abs(z - table_z) < config.reach  # NaN compares false
    points = cloud[near].astype(np.float64)
    if len(points) < config.min_points:
        return None
    middle = (workspace.x_min + workspace.x_max) / 2.0, (workspace.y_min + workspace.y_max) / 2.0
    design = np.column_stack([np.ones(len(points)), points[:, 0] - middle[0], points[:, 1] - middle[1]])
    plane = np.array([_lowest_level(points[:, 2], table_z, config), 0.0, 0.0])
    for _ in range(4):
        own = np.abs(points[:, 2] - design @ plane) < config.band
        if int(own.sum()) < config.min_points:
            return None
        plane = np.linalg.lstsq(design[own], points[own, 2], rcond=None)[0]
    return TablePlane(float(plane[0]), float(plane[1]), float(plane[2]), *middle)


def _lowest_level(heights: FloatArray, table_z: float, config: TableConfig) -> float:
    """Return the lowest height [m] about which many of the heights (N,) [m] lie: things' flat tops are levels, too."""
    width = config.band / 2.0
    bins = round(2.0 * config.reach / width)
    counts, edges = np.histogram(heights, bins, (table_z - config.reach, table_z + config.reach))
    full = counts >= config.level_share * counts.max()
    first = int(np.argmax(full))
    while first + 1 < bins and counts[first + 1] > counts[first]:
        first += 1
    return float((edges[first] + edges[first + 1]) / 2.0)
