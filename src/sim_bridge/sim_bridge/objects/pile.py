"""The small cubes that are swept, and the square outline into which they go (docs/benchmark.md, "Objects")."""

from __future__ import annotations

from functools import lru_cache

from cliport_core import Pose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision
from sim_bridge.objects.shape import Shape

PILE_BLOCK_SIZE = 0.01  # edge [m]
ZONE_OUTLINE = 0.12  # outer edge of the outline that is seen [m]
_LINE = 0.006  # its width [m]
_HEIGHT = 0.001  # [m]


@lru_cache(maxsize=1)
def pile_block_shape() -> Shape:
    """Return a cube of a gram; it is pushed, never held."""
    size = (PILE_BLOCK_SIZE,) * 3
    return Shape("small block", TriangleMesh.box(size), Collision.box(size), mass=0.001, friction=0.5)


@lru_cache(maxsize=1)
def zone_shape() -> Shape:
    """Return four flat strips, only seen; the frame in their middle, on the table."""
    middle = (ZONE_OUTLINE - _LINE) / 2
    along, across = (ZONE_OUTLINE, _LINE, _HEIGHT), (_LINE, ZONE_OUTLINE, _HEIGHT)
    strips = [(along, (0.0, -middle)), (along, (0.0, middle)), (across, (-middle, 0.0)), (across, (middle, 0.0))]
    mesh = TriangleMesh.joined(
        [
            TriangleMesh.box(size).transformed(Pose.from_xyz_rpy((x, y, _HEIGHT / 2), (0.0, 0.0, 0.0)))
            for size, (x, y) in strips
        ]
    )
    return Shape("square", mesh, None, mass=0.0)
