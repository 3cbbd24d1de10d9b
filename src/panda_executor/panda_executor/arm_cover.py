"""The arm's links as spheres that contain them: fast to compare with columns, points and each other."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial import ConvexHull

from panda_model import FloatArray

IntArray = npt.NDArray[np.int64]

_CELL = 0.05  # edge of the cubes whose part of a link's surface one sphere contains [m]
_FINE_CELL = 0.02  # edge of those into which such a part is divided where a first look at it is not enough [m]
_ALL = slice(None)
_SAMPLE = 0.008  # between two points of a link's surface [m]


class _Sphere(NamedTuple):
    """One sphere with the points (N, 3) [m] of a link's surface that it holds; the rest as in ArmCover."""

    joint: int
    centre: FloatArray
    radius: float
    part_of: int
    points: FloatArray


@dataclass(frozen=True, eq=False)
class ArmCover:
    """Spheres (N,) that move with the joints: every point of the links' hulls lies in one of them.

    joints: number of the joint that each moves with; centres: (N, 3) [m] in that joint's frame; radii: [m]; part_of:
    number of the larger sphere in a coarser cover whose points each holds; parts: smaller spheres that hold the same
    points, several for each of these.
    """

    joints: IntArray
    centres: FloatArray
    radii: FloatArray
    part_of: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    parts: ArmCover | None = None
    _moving: list[int] = field(init=False, repr=False)  # the joints that have spheres
    _group_of: IntArray = field(init=False, repr=False)  # (N,) of each sphere, its joint's number among those

    @classmethod
    def of_links(cls, model: pin.Model, geometry: pin.GeometryModel, links: tuple[str, ...]) -> ArmCover:
        """Make the spheres of the named links' hulls; names as the description has them."""
        coarse, fine = list[_Sphere](), list[_Sphere]()
        for item in geometry.geometryObjects:
            if model.frames[item.parentFrame].name not in links:
                continue
            points = _hull_surface(np.asarray(item.geometry.points()))
            points = points @ item.placement.rotation.T + item.placement.translation
            for sphere in _spheres(points, _CELL, item.parentJoint):
                fine += _spheres(sphere.points, _FINE_CELL, item.parentJoint, len(coarse))
                coarse.append(sphere)
        return replace(cls._of(coarse), parts=cls._of(fine))

    @classmethod
    def _of(cls, spheres: list[_Sphere]) -> ArmCover:
        return cls(
            np.array([sphere.joint for sphere in spheres], dtype=np.int64),
            np.array([sphere.centre for sphere in spheres]).reshape(-1, 3),
            np.array([sphere.radius for sphere in spheres]),
            np.array([sphere.part_of for sphere in spheres], dtype=np.int64),
        )

    def __post_init__(self) -> None:
        moving, group_of = np.unique(self.joints, return_inverse=True)
        object.__setattr__(self, "_moving", [int(joint) for joint in moving])
        object.__setattr__(self, "_group_of", group_of.ravel())

    def placed(self, data: pin.Data, which: IntArray | slice = _ALL) -> FloatArray:
        """Return the centres (N, 3) [m, base frame] for the joint placements that `data` holds; which: of them."""
        placements = [data.oMi[joint] for joint in self._moving]
        group_of = self._group_of[which]
        rotations = np.array([placement.rotation for placement in placements])[group_of]
        origins = np.array([placement.translation for placement in placements])[group_of]
        return np.einsum("nij,nj->ni", rotations, self.centres[which]) + origins


def _hull_surface(vertices: FloatArray) -> FloatArray:
    """Return points (N, 3) on the hull of vertices (M, 3), no further apart than `_SAMPLE` or so."""
    hull = ConvexHull(vertices)
    points = [vertices[hull.vertices]]
    for a, b, c in vertices[hull.simplices]:
        longest = max(float(np.linalg.norm(a - b)), float(np.linalg.norm(b - c)), float(np.linalg.norm(c - a)))
        n = int(np.ceil(longest / _SAMPLE))
        first, second = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = first + second <= n
        u, v = first[inside] / n, second[inside] / n
        points.append(a + u[:, None] * (b - a) + v[:, None] * (c - a))
    return np.concatenate(points)


def _spheres(points: FloatArray, edge: float, joint: int = 0, part_of: int = -1) -> list[_Sphere]:
    """Return a sphere for each cube of a grid, its edge [m], that holds some of the points (N, 3) [m]."""
    cells = np.floor((points - points.min(axis=0)) / edge).astype(np.int64)
    numbers = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
    order = np.argsort(numbers, kind="stable")
    found = []
    for mine in np.split(points[order], np.flatnonzero(np.diff(numbers[order])) + 1):
        centre = (mine.min(axis=0) + mine.max(axis=0)) / 2.0
        radius = float(np.linalg.norm(mine - centre, axis=1).max()) + _SAMPLE / 2.0
        found.append(_Sphere(joint, centre, radius, part_of, mine))
    return found
