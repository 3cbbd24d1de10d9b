"""The bowl: round, with a real hollow in physics."""

from __future__ import annotations

import math
from functools import lru_cache

from cliport_core import Pose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import BoxPart, Collision, CylinderPart
from sim_bridge.objects.shape import Shape

BOWL_RADIUS = 0.057  # outer, at the rim [m]
BOWL_BASE_RADIUS = 0.050  # outer, at the table [m]
BOWL_HEIGHT = 0.035  # [m]
BOWL_FLOOR = 0.008  # thickness [m]
BOWL_WALL = 0.005  # thickness [m]
BOWL_MASS = 0.1  # of a bowl that can move [kg]

_WALL_PIECES = 15  # with the floor as many pieces as PyBullet allows in one compound shape


@lru_cache(maxsize=1)
def bowl_shape() -> Shape:
    """Return the bowl (docs/benchmark.md, "Objects"), its frame on its axis at half its height."""
    low, rim, floor = -BOWL_HEIGHT / 2, BOWL_HEIGHT / 2, -BOWL_HEIGHT / 2 + BOWL_FLOOR
    inner_floor = _outer_radius(BOWL_FLOOR) - BOWL_WALL
    profile = [
        (0.0, low),
        (BOWL_BASE_RADIUS, low),
        (BOWL_RADIUS, rim),
        (BOWL_RADIUS - BOWL_WALL, rim),
        (inner_floor, floor),
        (0.0, floor),
    ]
    return Shape("bowl", TriangleMesh.revolved(profile, segments=48), _collision(), BOWL_MASS, symmetry=0.0)


def _outer_radius(height: float) -> float:
    """Return the radius [m] of the outside at a height [m] above the bowl's underside."""
    return BOWL_BASE_RADIUS + (BOWL_RADIUS - BOWL_BASE_RADIUS) * height / BOWL_HEIGHT


def _collision() -> Collision:
    """Return leaning wall boxes in a ring, and a disc for the floor."""
    lean = math.atan2(BOWL_RADIUS - BOWL_BASE_RADIUS, BOWL_HEIGHT)
    wall_height = BOWL_HEIGHT / math.cos(lean) - BOWL_WALL * math.tan(lean)
    # the boxes' corners, not their middles, touch the round outline: then nothing sticks out of what is seen
    flat = math.cos(math.pi / _WALL_PIECES)
    middle = (BOWL_BASE_RADIUS + BOWL_RADIUS) / 2 * flat - BOWL_WALL / 2 / math.cos(lean)
    width = 2 * (BOWL_RADIUS * flat) * math.tan(math.pi / _WALL_PIECES)
    parts: list[BoxPart | CylinderPart] = []
    for i in range(_WALL_PIECES):
        angle = 2.0 * math.pi * i / _WALL_PIECES
        at = (middle * math.cos(angle), middle * math.sin(angle), 0.0)
        parts.append(BoxPart((BOWL_WALL, width, wall_height), Pose.from_xyz_rpy(at, (0.0, lean, angle))))
    floor = Pose.from_xyz_rpy((0.0, 0.0, -BOWL_HEIGHT / 2 + BOWL_FLOOR / 2), (0.0, 0.0, 0.0))
    parts.append(CylinderPart(BOWL_BASE_RADIUS - BOWL_WALL / 2, BOWL_FLOOR, floor))
    return Collision(tuple(parts))
