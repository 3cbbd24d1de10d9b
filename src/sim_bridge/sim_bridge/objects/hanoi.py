"""Stand, pegs and rings of the towers of Hanoi; a ring's hole is real in physics."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from sim_bridge.colors import rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import HULL_PADDING, BoxPart, Collision, CylinderPart, HullPart
from sim_bridge.objects.shape import Pinch, Shape
from sim_bridge.objects.tiles import tile_row

HANOI_TILE = 0.12  # edge, and distance between the pegs [m]
HANOI_STAND_HEIGHT = 0.01  # of the tiles [m]
PEG_RADIUS = 0.005  # [m]
PEG_HEIGHT = 0.045  # above the tiles: the third ring is threaded, too, and the palm clears it beside the lowest [m]
RING_DIAMETERS = (0.05, 0.06, 0.07)  # small to large [m]
HOLE_DIAMETER = 0.03  # [m]
RING_THICKNESS = 0.02  # [m]
RING_MASS = 0.1  # [kg]

_PEG_MIDDLE = (HANOI_STAND_HEIGHT + PEG_HEIGHT) / 2  # in the stand's frame [m]
_PIECES = 12  # of a ring in physics, one on its x axis: the jaws close on two that face each other
_PIECE = math.tau / _PIECES  # [rad]
_FEET = 3  # pieces on which a ring stands; if all touched what is below, a step would take three times as long
_FOOT = 0.0015  # by which they reach lower; PyBullet keeps contacts that are open by up to a millimetre [m]
_CORNERS = 48  # of a ring as it is seen


@lru_cache(maxsize=1)
def hanoi_stand_shape() -> Shape:
    """Return three tiles with a peg on each (docs/benchmark.md, "Objects"), its frame in the tiles' middle."""
    pegs = [
        CylinderPart(PEG_RADIUS, PEG_HEIGHT, Pose.from_xyz_rpy((0.0, y, _PEG_MIDDLE), (0.0, 0.0, 0.0)))
        for y in (-HANOI_TILE, 0.0, HANOI_TILE)
    ]
    tiles = BoxPart((HANOI_TILE, 3 * HANOI_TILE, HANOI_STAND_HEIGHT), Pose.identity())
    half = PEG_HEIGHT / 2
    peg = TriangleMesh.revolved([(0.0, -half), (PEG_RADIUS, -half), (PEG_RADIUS, half), (0.0, half)], segments=16)
    meshes = [tile_row(HANOI_TILE, HANOI_STAND_HEIGHT), *(peg.transformed(p.pose).colored(rgb("brown")) for p in pegs)]
    parts: list[BoxPart | CylinderPart] = [tiles, *pegs]
    return Shape("stand", TriangleMesh.joined(meshes), Collision(parts), mass=0.5, friction=0.5)


@lru_cache(maxsize=len(RING_DIAMETERS))
def ring_shape(diameter: float) -> Shape:
    """Return a ring of outer `diameter` [m], its frame in its middle."""
    down = Pose.from_xyz_rpy((0.0, 0.0, -RING_THICKNESS / 2), (0.0, 0.0, 0.0))
    outer, inner = _circle(diameter / 2, _CORNERS, 0.0), _circle(HOLE_DIAMETER / 2, _CORNERS, 0.0)
    mesh = TriangleMesh.extruded(outer, RING_THICKNESS, holes=[inner]).transformed(down)
    pinches = tuple(Pinch(0.0, 0.0, i * _PIECE, diameter) for i in range(_PIECES // 2))
    return Shape("ring", mesh, Collision(_pieces(diameter)), RING_MASS, symmetry=0.0, pinches=pinches)


def _pieces(diameter: float) -> list[HullPart]:
    """Return blocks side by side around the hole, smaller by what PyBullet adds to them."""
    outer = _circle(diameter / 2 - HULL_PADDING, _PIECES, -_PIECE / 2)
    inner = _circle(HOLE_DIAMETER / 2 + HULL_PADDING, _PIECES, -_PIECE / 2)
    half = RING_THICKNESS / 2 - HULL_PADDING
    pieces = []
    for i in range(_PIECES):
        ends = [i, (i + 1) % _PIECES]
        outline = np.concatenate([outer[ends], inner[ends]])
        low = -half if i % (_PIECES // _FEET) == 0 else -half + _FOOT
        pieces.append(HullPart(np.concatenate([np.column_stack([outline, np.full(4, z)]) for z in (low, half)])))
    return pieces


def _circle(radius: float, corners: int, first: float) -> npt.NDArray[np.float64]:
    """Return (N, 2) corners on a circle [m], the first at that angle [rad]."""
    angles = first + np.arange(corners) * (math.tau / corners)
    return radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
