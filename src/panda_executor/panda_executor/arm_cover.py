"""The arm's links as spheres that contain them: fast to compare with columns, points and each other."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from scipy.spatial import ConvexHull

from panda_model import FloatArray

IntArray = npt.NDArray[np.int64]

_CELL = 0.05  # edge of the cubes whose part of a link's surface one sphere contains [m]
_SAMPLE = 0.008  # between two points of a link's surface [m]


@dataclass(frozen=True, eq=False)
class ArmCover:
    """Spheres (N,) that move with the joints: every point of the links' hulls lies in one of them.

    joints: number of the joint that each moves with; centres: (N, 3) [m] in that joint's frame; radii: [m].
    """

    joints: IntArray
    centres: FloatArray
    radii: FloatArray
    _moving: list[int] = field(init=False, repr=False)  # the joints that have spheres
    _group_of: IntArray = field(init=False, repr=False)  # (N,) of each sphere, its joint's number among those

    @classmethod
    def of_links(cls, model: pin.Model, geometry: pin.GeometryModel, links: tuple[str, ...]) -> ArmCover:
        """Make the spheres of the named links' hulls; names as the description has them."""
        joints: list[int] = []
        spheres: list[tuple[FloatArray, float]] = []
        for item in geometry.geometryObjects:
            if model.frames[item.parentFrame].name not in links:
                continue
            points = _hull_surface(np.asarray(item.geometry.points()))
            found = _spheres(points @ item.placement.rotation.T + item.placement.translation)
            joints += [item.parentJoint] * len(found)
            spheres += found
        return cls(
            np.array(joints, dtype=np.int64),
            np.array([centre for centre, _ in spheres]).reshape(-1, 3),
            np.array([radius for _, radius in spheres]),
        )

    def __post_init__(self) -> None:
        moving, group_of = np.unique(self.joints, return_inverse=True)
        object.__setattr__(self, "_moving", [int(joint) for joint in moving])
        object.__setattr__(self, "_group_of", group_of.ravel())

    def placed(self, data: pin.Data) -> FloatArray:
        """Return the centres (N, 3) [m, base frame] for the joint placements that `data` holds."""
        placements = [data.oMi[joint] for joint in self._moving]
        rotations = np.array([placement.rotation for placement in placements])[self._group_of]
        origins = np.array([placement.translation for placement in placements])[self._group_of]
        return np.einsum("nij,nj->ni", rotations, self.centres) + origins


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


def _spheres(points: FloatArray) -> list[tuple[FloatArray, float]]:
    """Return centre and radius [m] of a sphere for each cube of the grid that holds some of the points (N, 3)."""
    cells = np.floor((points - points.min(axis=0)) / _CELL).astype(np.int64)
    _, index = np.unique(cells, axis=0, return_inverse=True)
    found = []
    for cell in range(int(index.max()) + 1):
        mine = points[index.ravel() == cell]
        centre = (mine.min(axis=0) + mine.max(axis=0)) / 2.0
        found.append((centre, float(np.linalg.norm(mine - centre, axis=1).max()) + _SAMPLE / 2.0))
    return found
