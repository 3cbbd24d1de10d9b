"""The kit: a slab with prints where the kitting shapes belong (docs/benchmark.md, "Objects")."""

from __future__ import annotations

from functools import lru_cache

from cliport_core import Pose
from sim_bridge.colors import Rgb, rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision
from sim_bridge.objects.kit_shapes import KIT_SHAPES
from sim_bridge.objects.shape import Shape

KIT_SIZE = (0.28, 0.20, 0.005)  # [m]
HOLES_IN_KIT = ((-0.09, 0.045), (0.0, 0.045), (0.09, 0.045), (-0.045, -0.045), (0.045, -0.045))  # x, y [m]
HOLE_RGB: Rgb = (51, 51, 51)

_PRINT = 0.0009  # how far a print rises above the slab [m]


@lru_cache(maxsize=1)
def kit_slab() -> Shape:
    """Return the brown slab, its frame in its middle."""
    mesh = TriangleMesh.box(KIT_SIZE).colored(rgb("brown"))
    return Shape("kit", mesh, Collision.box(KIT_SIZE), mass=0.5)


@lru_cache(maxsize=len(KIT_SHAPES))
def hole_shape(index: int) -> Shape:
    """Return the print of a kitting shape, its frame on the slab's top.

    It is only seen: the original's edge of 0.9 mm would tilt what lies half on it and stop what slides into place.
    """
    row = KIT_SHAPES[index]
    outline = row.outline()
    mesh = TriangleMesh.extruded(outline.corners, _PRINT, outline.holes).colored(HOLE_RGB)
    return Shape(f"{row.name} hole", mesh, None, mass=0.0, symmetry=row.symmetry)


def hole_poses(kit: Pose) -> list[Pose]:
    """Return the poses of the five prints' middles on a kit's top, turned as the kit is."""
    top = KIT_SIZE[2] / 2
    return [kit @ Pose.from_xyz_rpy((x, y, top), (0.0, 0.0, 0.0)) for x, y in HOLES_IN_KIT]
