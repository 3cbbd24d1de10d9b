"""View of the backdrop alone: made once for as long as camera and light stay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.backdrop import FLOOR_Z, TABLE_X, TABLE_Y, TABLE_Z
from sim_bridge.rendering.lit_scene import LitScene
from sim_bridge.rendering.part import parts_of
from sim_bridge.rendering.rays import Rays
from sim_bridge.rendering.shading import shade

_EDGE_MARGIN = 1e-3  # this near to the table's edge, rays decide [m]
_UP = np.array([0.0, 0.0, 1.0], dtype=np.float32)


@dataclass(frozen=True, eq=False)
class BackdropView:
    """The backdrop without bodies, along N rays: depth, facing (N,), color (N, 3) as in a CleanFrame.

    normal (N, 3) of the surfaces. sunny_table, sunny_floor (N,): where the light reaches either. lowest: height of the
    lowest thing that can be seen [m].
    """

    rays: Rays
    depth: npt.NDArray[np.float32]
    facing: npt.NDArray[np.float32]
    color: npt.NDArray[np.uint8]
    normal: npt.NDArray[np.float32]
    sunny_table: npt.NDArray[np.bool_]
    sunny_floor: npt.NDArray[np.bool_]
    lowest: float

    @classmethod
    def along(cls, rays: Rays, appearance: Appearance, n_threads: int) -> BackdropView:
        """Make the view: the table's top by geometry, all else by casting rays; n_threads: 0 uses every core."""
        depth, is_top = _table_top(rays)
        normal = np.tile(_UP, (len(depth), 1))
        table = np.array([appearance.table_rgb], dtype=np.float32)
        color = np.tile(shade(appearance, table, normal[:1], False), (len(depth), 1))
        if appearance.table_texture is not None:
            top = np.flatnonzero(is_top)
            points = rays.take(top).points(depth[top])
            color[top] = shade(appearance, appearance.table_colors(points), normal[top], False)
        sunny = np.ones(len(depth), dtype=bool)  # the table's top: nothing of the backdrop rises above it
        rest = np.flatnonzero(~is_top)
        seen = LitScene(parts_of([], appearance, n_threads), appearance).look(rays.take(rest))
        depth[rest], normal[rest], color[rest], sunny[rest] = seen
        there = np.isfinite(depth)
        height = rays.origin[2] + rays.directions[:, 2] * np.where(there, depth, 0.0)
        on_table = there & (height > (TABLE_Z[1] + FLOOR_Z[0]) / 2)
        lowest = (TABLE_Z if on_table.all() else FLOOR_Z)[1]
        return cls(rays, depth, rays.facing(normal), color, normal, sunny & on_table, sunny & ~on_table, lowest)


def _table_top(rays: Rays) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Return the depth (N,) of the plane z = 0, and whether the ray meets the table's top there."""
    down = np.minimum(rays.directions[:, 2], np.float32(-1e-6))
    depth = -rays.origin[2] / down
    x = rays.origin[0] + depth * rays.directions[:, 0]
    y = rays.origin[1] + depth * rays.directions[:, 1]
    is_top = (depth > 0.0) & (x > TABLE_X[0] + _EDGE_MARGIN) & (x < TABLE_X[1] - _EDGE_MARGIN)
    return depth, is_top & (y > TABLE_Y[0] + _EDGE_MARGIN) & (y < TABLE_Y[1] - _EDGE_MARGIN)
