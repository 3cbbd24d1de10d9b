"""Surfaces that rays meet in a lit scene, in light or shadow."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.part import Part
from sim_bridge.rendering.rays import Rays
from sim_bridge.rendering.shading import shade, towards_light

_LIFT = 5e-4  # shadow rays start this far off the surface [m]


class Seen(NamedTuple):
    """Ends of K rays: depth (K,) [m], inf for nowhere; normal (K, 3), zero for nowhere; shown colour (K, 3); sunny
    (K,): whether the light reaches there."""

    depth: npt.NDArray[np.float32]
    normal: npt.NDArray[np.float32]
    color: npt.NDArray[np.uint8]
    sunny: npt.NDArray[np.bool_]


class LitScene:
    """Parts under one light. What a ray meets depends on nothing but the ray and the parts."""

    def __init__(self, parts: Sequence[Part], appearance: Appearance) -> None:
        self._parts = parts
        self._appearance = appearance
        self._to_light = np.array(appearance.to_light, dtype=np.float32)

    def look(self, rays: Rays) -> Seen:
        """Return the first surfaces that rays meet, in light or shadow; beyond
        everything there is the floor's colour in shadow."""
        n = len(rays.lengths)
        depth = np.full(n, np.inf, dtype=np.float32)
        normal = np.zeros((n, 3), dtype=np.float32)
        color = np.tile(np.array(self._appearance.floor_rgb, dtype=np.float32), (n, 1))
        for part in self._parts:
            struck = part.strike(rays, depth)
            depth[struck.rows], normal[struck.rows], color[struck.rows] = struck.depth, struck.normal, struck.color
        sunny = self.sunny(rays, depth, normal)
        return Seen(depth, normal, shade(self._appearance, color, normal, ~sunny), sunny)

    def sunny(
        self, rays: Rays, depth: npt.NDArray[np.float32], normal: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.bool_]:
        """Return (K,) whether the light reaches surfaces of these normals (K, 3) that rays meet at depths (K,) [m]."""
        sunny = towards_light(self._appearance, normal) > 0.0
        rows = np.flatnonzero(sunny)
        points = rays.take(rows).points(depth.take(rows))
        points += normal.take(rows, axis=0) * np.float32(_LIFT)
        for part in self._parts:
            sunny[rows] &= ~part.blocks(points, self._to_light)
        return sunny
