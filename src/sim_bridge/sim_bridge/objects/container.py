"""The brown box of the packing tasks: a floor and four walls, open at the top."""

from __future__ import annotations

from cliport_core import Pose
from sim_bridge.colors import rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import BoxPart, Collision
from sim_bridge.objects.shape import Shape

CONTAINER_HEIGHT = 0.05  # [m]
WALL = 0.002  # thickness of floor and walls [m]


def container_shape(width: float, depth: float) -> Shape:
    """Return a container of outer size width (x) and depth (y) [m] (docs/benchmark.md, "Objects"), its frame at half
    its height; the walls' middles lie on its outline."""
    low, tall = -CONTAINER_HEIGHT / 2, CONTAINER_HEIGHT
    boxes = [
        ((width, depth, WALL), (0.0, 0.0, low + WALL / 2)),
        ((WALL, depth, tall), (-width / 2, 0.0, 0.0)),
        ((WALL, depth, tall), (width / 2, 0.0, 0.0)),
        ((width, WALL, tall), (0.0, -depth / 2, 0.0)),
        ((width, WALL, tall), (0.0, depth / 2, 0.0)),
    ]
    parts = tuple(BoxPart(size, Pose.from_xyz_rpy(at, (0.0, 0.0, 0.0))) for size, at in boxes)
    mesh = TriangleMesh.joined([TriangleMesh.box(p.size).transformed(p.pose) for p in parts]).colored(rgb("brown"))
    return Shape("brown box", mesh, Collision(parts), mass=0.5, friction=0.3)
