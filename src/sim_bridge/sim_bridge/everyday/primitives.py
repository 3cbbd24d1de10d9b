"""Elements of everyday objects: convex solids, and coloured markings on them.

Lengths are millimetres and angles degrees here and in the tables that use this; meshes come out in metres.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from sim_bridge.colors import Rgb
from sim_bridge.geometry.mesh import TriangleMesh

FloatArray = npt.NDArray[np.float64]
Point = tuple[float, float, float]

_MM = 0.001
_ROUND = 28  # sides of what looks round
_SMALL = 16.0  # a ball with smaller radii needs fewer [mm]
_THIN = 4.5  # so does a thinner rod [mm]
_EQUAL_SIZE = 1.03  # of a faceted ball, so that it is as large as the round one
_FACETS = 12  # sides of it in physics: with flats, so that it does not roll away


@dataclass(frozen=True, kw_only=True)
class Primitive(ABC):
    """Element of an object. at: origin of its own frame; turn: roll, pitch, yaw
    about fixed axes; solid: whether it collides."""

    at: Point = (0.0, 0.0, 0.0)
    turn: Point = (0.0, 0.0, 0.0)
    solid: bool = True

    def mesh(self) -> TriangleMesh:
        """Return coloured triangles in the object's frame [m]."""
        return self._mesh().transformed(scale=_MM).transformed(self._pose)

    def hulls(self) -> list[FloatArray]:
        """Return corners (N, 3) of the convex pieces that it collides as, in the object's frame [m]."""
        return [self._pose.apply(piece * _MM) for piece in self._pieces()] if self.solid else []

    @property
    def _pose(self) -> Pose:
        return Pose.from_xyz_rpy(np.array(self.at) * _MM, np.radians(self.turn))

    @abstractmethod
    def _mesh(self) -> TriangleMesh:
        """Return triangles in its own frame [mm]."""

    @abstractmethod
    def _pieces(self) -> list[FloatArray]:
        """Return corners of convex pieces in its own frame [mm]."""


Parts = tuple[Primitive, ...]


@dataclass(frozen=True)
class Ball(Primitive):
    """An ellipsoid about its frame's origin."""

    color: Rgb
    radii: Point

    def _mesh(self) -> TriangleMesh:
        small = max(self.radii) < _SMALL
        steps = np.linspace(-math.pi / 2, math.pi / 2, 7 if small else 11)
        profile = [(max(math.cos(s), 0.0), math.sin(s)) for s in steps]
        ball = TriangleMesh.revolved(profile, _ROUND // 2 if small else _ROUND)
        return ball.transformed(scale=self.radii).colored(self.color)

    def _pieces(self) -> list[FloatArray]:
        rings = [_ring(math.cos(s), math.sin(s), _FACETS) for s in np.radians((-70.0, -25.0, 25.0, 70.0))]
        return [np.concatenate(rings) * np.array(self.radii) * _EQUAL_SIZE]


@dataclass(frozen=True)
class Rod(Primitive):
    """A round bar between two points, its radius changing evenly from `radius` to `end_radius`."""

    color: Rgb
    start: Point
    end: Point
    radius: float
    end_radius: float | None = None

    def _mesh(self) -> TriangleMesh:
        length, pose = self._axis
        profile = [(0.0, 0.0), (self.radius, 0.0), (self._end_radius, length), (0.0, length)]
        sides = 8 if self.radius < _THIN else _ROUND // 2
        return TriangleMesh.revolved(profile, sides).transformed(pose).colored(self.color)

    def _pieces(self) -> list[FloatArray]:
        length, pose = self._axis
        return [pose.apply(np.concatenate([_ring(self.radius, 0.0, 8), _ring(self._end_radius, length, 8)]))]

    @property
    def _end_radius(self) -> float:
        return max(self.radius if self.end_radius is None else self.end_radius, 0.01)

    @property
    def _axis(self) -> tuple[float, Pose]:
        """Return its length and a frame at its start with z along it."""
        along = np.subtract(self.end, self.start)
        length = float(np.linalg.norm(along))
        tilt, heading = math.acos(along[2] / length), math.atan2(along[1], along[0])
        return length, Pose.from_xyz_rpy(self.start, (0.0, tilt, heading))


@dataclass(frozen=True)
class Prism(Primitive):
    """A plate: corners of its outline in the xy plane, from z = -height / 2 to height / 2.

    It collides as the hulls of `pieces` of its outline, each a range of corners (first, last), or as one.
    """

    color: Rgb
    outline: Sequence[tuple[float, float]]
    height: float
    holes: Sequence[Sequence[tuple[float, float]]] = ()
    pieces: Sequence[Sequence[int]] = ()

    def _mesh(self) -> TriangleMesh:
        mesh = TriangleMesh.extruded(self.outline, self.height, self.holes)
        return mesh.transformed(Pose(np.eye(3), np.array([0.0, 0.0, -self.height / 2]))).colored(self.color)

    def _pieces(self) -> list[FloatArray]:
        corners = np.array(self.outline, dtype=np.float64)
        parts = [corners[list(piece)] for piece in self.pieces] or [corners]
        return [np.concatenate([_at_height(p, -self.height / 2), _at_height(p, self.height / 2)]) for p in parts]


@dataclass(frozen=True)
class Turned(Primitive):
    """A body turned on a lathe about z: rings of (radius, height, colour up
    to the next ring), from the bottom to the top.

    cuts: heights at which it is cut into convex pieces. hollow: (radius, depth) of a hole from above that is
    only seen. oval: its y radii are this share of those along x.
    """

    rings: Sequence[tuple[float, float, Rgb]]
    cuts: Sequence[float] = ()
    hollow: tuple[float, float] | None = None
    inside: Rgb = (60, 58, 56)
    oval: float = 1.0

    def _mesh(self) -> TriangleMesh:
        rings = [(max(r, 0.01), z) for r, z, _ in self.rings]
        colors = [self.rings[0][2], *(color for _, _, color in self.rings)]  # of each edge; the last is the top
        if self.hollow is not None:
            radius, depth = self.hollow
            rings += [(radius, rings[-1][1]), (radius * 0.94, rings[-1][1] - depth)]
            colors += [self.inside, self.inside]
        profile = [(0.0, rings[0][1]), *rings, (0.0, rings[-1][1])]
        mesh = TriangleMesh.revolved(profile, _ROUND)
        strips = [color for color in colors[1:-1] for _ in (0, 1)]
        look = np.array([[colors[0], colors[-1], *strips]] * _ROUND, dtype=np.uint8).reshape(-1, 3)
        return mesh.transformed(scale=(1.0, self.oval, 1.0)).colored(look)

    def _pieces(self) -> list[FloatArray]:
        edges = [-math.inf, *self.cuts, math.inf]
        flat = (1.0, self.oval, 1.0)
        pieces = [[_ring(max(r, 0.5), z, _FACETS) for r, z, _ in self.rings if a <= z <= b] for a, b in pairwise(edges)]
        return [np.concatenate(rings) * flat for rings in pieces if len(rings) > 1]


def block(color: Rgb, size: Point, at: Point = (0.0, 0.0, 0.0), corner: float = 0.0, **more: object) -> Prism:
    """Return a box of that size about `at`, its upright edges rounded by `corner`."""
    x, y = size[0] / 2, size[1] / 2
    return Prism(color, rounded(x, y, corner), size[2], at=at, **more)  # type: ignore[arg-type]


def rounded(half_x: float, half_y: float, corner: float) -> tuple[tuple[float, float], ...]:
    """Return corners of a rectangle about the origin whose corners are rounded."""
    if corner <= 0.0:
        return ((half_x, half_y), (-half_x, half_y), (-half_x, -half_y), (half_x, -half_y))
    middles = ((1, 1, 0), (-1, 1, 90), (-1, -1, 180), (1, -1, 270))
    return tuple(
        (
            sx * (half_x - corner) + corner * math.cos(math.radians(start + step)),
            sy * (half_y - corner) + corner * math.sin(math.radians(start + step)),
        )
        for sx, sy, start in middles
        for step in (0.0, 30.0, 60.0, 90.0)
    )


def round_outline(radius_x: float, radius_y: float, sides: int = 24) -> tuple[tuple[float, float], ...]:
    """Return corners of an ellipse about the origin."""
    return tuple((radius_x * x, radius_y * y) for x, y in _ring(1.0, 0.0, sides)[:, :2])


def bent(color: Rgb, points: Sequence[Point], radius: float, solid: bool = True) -> Parts:
    """Return a bar that follows points."""
    return tuple(Rod(color, a, b, radius, solid=solid) for a, b in pairwise(points))


def arc(middle: Point, radius: float, start: float, end: float, plane: str = "xz", steps: int = 6) -> tuple[Point, ...]:
    """Return points on an arc in the plane "xy", "xz" or "yz", angles counted from its first axis to its second."""
    points = []
    for angle in np.radians(np.linspace(start, end, steps + 1)):
        offset = dict(zip(plane, (radius * math.cos(angle), radius * math.sin(angle)), strict=True))
        x, y, z = (at + offset.get(axis, 0.0) for axis, at in zip("xyz", middle, strict=True))
        points.append((x, y, z))
    return tuple(points)


def _ring(radius: float, z: float, sides: int) -> FloatArray:
    """Return (sides, 3) corners of a level polygon about z."""
    angles = np.arange(sides) * (2.0 * math.pi / sides)
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(sides, z)])


def _at_height(flat: FloatArray, z: float) -> FloatArray:
    return np.column_stack([flat, np.full(len(flat), z)])
