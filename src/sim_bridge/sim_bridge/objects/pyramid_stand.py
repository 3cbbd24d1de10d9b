"""The stand of the block pyramids: three brown tiles in a row, the lightest at -y."""

from __future__ import annotations

from functools import lru_cache

from sim_bridge.objects.collision import Collision
from sim_bridge.objects.shape import Shape
from sim_bridge.objects.tiles import tile_row

PYRAMID_TILE = 0.05  # edge, and distance between the tiles' middles [m]
PYRAMID_STAND_HEIGHT = 0.005  # [m]


@lru_cache(maxsize=1)
def pyramid_stand_shape() -> Shape:
    """Return the stand (docs/benchmark.md, "Objects"), its frame in its middle."""
    size = (PYRAMID_TILE, 3 * PYRAMID_TILE, PYRAMID_STAND_HEIGHT)
    return Shape("stand", tile_row(PYRAMID_TILE, PYRAMID_STAND_HEIGHT), Collision.box(size), mass=0.5)
