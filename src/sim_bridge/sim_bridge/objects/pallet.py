"""The pallet on which boxes are stacked."""

from __future__ import annotations

from functools import lru_cache

from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision
from sim_bridge.objects.shape import Shape

PALLET_SIZE = (0.30, 0.25, 0.0375)  # [m]
_WOOD = (222, 184, 135)


@lru_cache(maxsize=1)
def pallet_shape() -> Shape:
    """Return the pallet (docs/benchmark.md, "Objects"), its frame in its middle."""
    mesh = TriangleMesh.box(PALLET_SIZE).colored(_WOOD)
    return Shape("pallet", mesh, Collision.box(PALLET_SIZE), mass=2.0)
