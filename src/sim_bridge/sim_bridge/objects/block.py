"""Solid cuboids: the stacking cube and boxes of any size."""

from __future__ import annotations

import math
from functools import lru_cache

from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision
from sim_bridge.objects.shape import Pinch, Shape
from sim_bridge.robot import HAND

BLOCK_SIZE = 0.04  # edge [m]
BLOCK_MASS = 0.03  # [kg]
BOX_MASS = 0.1  # of a box of any size [kg]
WIDEST_PINCH = HAND.widest - 0.003  # widest thing that the hand takes, with a margin [m]


@lru_cache(maxsize=1)
def block_shape() -> Shape:
    """Return the cube of the bowl and pyramid tasks (docs/benchmark.md, "Objects"), heavier for steadier grasps."""
    return cuboid("block", (BLOCK_SIZE, BLOCK_SIZE, BLOCK_SIZE), BLOCK_MASS)


def cuboid(name: str, size: tuple[float, float, float], mass: float, friction: float = 1.0) -> Shape:
    """Return a box of `size` (x, y, z) [m], its frame in its middle."""
    x, y, _ = size
    square = math.isclose(x, y)
    pinches = sorted((Pinch(0.0, 0.0, yaw, w) for yaw, w in ((0.0, x), (math.pi / 2, y))), key=lambda p: p.width)
    return Shape(
        name,
        TriangleMesh.box(size),
        Collision.box(size),
        mass,
        symmetry=math.pi / 2 if square else math.pi,
        friction=friction,
        pinches=tuple(p for p in pinches if p.width <= WIDEST_PINCH),
    )
