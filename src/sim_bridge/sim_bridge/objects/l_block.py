"""The L-shaped block, and the fixture into which it goes."""

from __future__ import annotations

import math
from functools import lru_cache

from cliport_core import Pose
from sim_bridge.colors import rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import BoxPart, Collision
from sim_bridge.objects.shape import Pinch, Shape

LEG_LENGTH = 0.08  # outside, along each side [m]
LEG_WIDTH = 0.03  # [m]
L_HEIGHT = 0.04  # of the block [m]
CLEARANCE = 0.01  # between block and fixture, each side [m]
FIXTURE_HEIGHT = 0.02  # of its walls: the fingers, which hold the block's top, pass over them [m]
FIXTURE_WALL = 0.002  # thickness [m]
L_MASS = 0.1  # [kg]

_LOW, _HIGH = -LEG_WIDTH / 2, LEG_LENGTH - LEG_WIDTH / 2  # of the block's outline
_PINCH_AT = 0.035  # along a leg: clear of the other leg, near the block's middle [m]


@lru_cache(maxsize=1)
def l_block_shape() -> Shape:
    """Return two bars that share a corner (docs/benchmark.md, "Objects"), its frame in the middle of that corner."""
    outline = _l_outline(0.0)
    mesh = TriangleMesh.extruded(outline, L_HEIGHT).transformed(Pose.from_xyz_rpy((0, 0, -L_HEIGHT / 2), (0, 0, 0)))
    along = _box((_LOW, _HIGH), (_LOW, -_LOW), L_HEIGHT)
    across = _box((_LOW, -_LOW), (-_LOW, _HIGH), L_HEIGHT)
    pinches = (Pinch(_PINCH_AT, 0.0, math.pi / 2, LEG_WIDTH), Pinch(0.0, _PINCH_AT, 0.0, LEG_WIDTH))
    return Shape("L block", mesh, Collision((along, across)), L_MASS, friction=0.3, pinches=pinches)


@lru_cache(maxsize=1)
def l_fixture_shape() -> Shape:
    """Return walls around an L-shaped channel without a floor; the block in its middle has the same planar pose."""
    half = FIXTURE_WALL / 2
    corners = _l_outline(CLEARANCE + half)
    walls = []
    for ends in zip(corners, corners[1:] + corners[:1], strict=True):
        (x0, x1), (y0, y1) = (sorted(values) for values in zip(*ends, strict=True))
        walls.append(_box((x0 - half, x1 + half), (y0 - half, y1 + half), FIXTURE_HEIGHT))
    mesh = TriangleMesh.joined([TriangleMesh.box(wall.size).transformed(wall.pose) for wall in walls])
    return Shape("L fixture", mesh.colored(rgb("gray")), Collision(tuple(walls)), mass=0.5, friction=0.3)


def _l_outline(grown: float) -> list[tuple[float, float]]:
    """Return the corners of the block's outline, counter-clockwise, moved outwards by `grown` [m]."""
    low, inner, high = _LOW - grown, -_LOW + grown, _HIGH + grown
    return [(low, low), (high, low), (high, inner), (inner, inner), (inner, high), (low, high)]


def _box(x: tuple[float, float], y: tuple[float, float], height: float) -> BoxPart:
    """Return a box between those bounds [m], about z = 0."""
    size = (x[1] - x[0], y[1] - y[0], height)
    return BoxPart(size, Pose.from_xyz_rpy(((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, 0.0), (0.0, 0.0, 0.0)))
