"""The backdrop around the things: the table's visible sheet, its top at z = 0, and the floor. It never moves."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.rendering.appearance import Appearance

TABLE_X = (-0.3, 0.85)  # base frame [m]
TABLE_Y = (-0.65, 0.65)
TABLE_Z = (0.0, -0.03)  # top and underside [m]
FLOOR_Z = (-0.745, -0.755)
TABLE_TRIANGLES = 12  # the first ones of the backdrop's mesh; the others are the floor's
_FLOOR_XY = (-4.0, 4.0)


@lru_cache(maxsize=1)
def backdrop_mesh() -> TriangleMesh:
    """Return table and floor in the base frame."""
    return TriangleMesh.joined([_box(TABLE_X, TABLE_Y, TABLE_Z), _box(_FLOOR_XY, _FLOOR_XY, FLOOR_Z)])


def backdrop_colors(appearance: Appearance) -> npt.NDArray[np.float32]:
    """Return a colour 0..255 for each triangle of the backdrop's mesh, (M, 3)."""
    colors = np.empty((len(backdrop_mesh().triangles), 3), dtype=np.float32)
    colors[:TABLE_TRIANGLES] = appearance.table_rgb
    colors[TABLE_TRIANGLES:] = appearance.floor_rgb
    return colors


def _box(*ranges: tuple[float, float]) -> TriangleMesh:
    """Return a box between two x, two y and two z [m]."""
    x, y, z = (abs(a - b) for a, b in ranges)
    return TriangleMesh.box((x, y, z)).transformed(Pose(np.eye(3), np.mean(ranges, axis=1)))
