"""An everyday object at its own size, from which shapes of any size are made.

See docs/benchmark.md, "Everyday objects".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from cliport_core import Pose
from sim_bridge.errors import SimulationError
from sim_bridge.everyday.merging import merged
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import Collision, HullPart, Shape

FloatArray = npt.NDArray[np.float64]

MASS = 0.1  # of every object, whatever its size [kg]
FRICTION = 1.0
ROLLING_FRICTION = 0.002  # round things come to rest where they fell [m]
SCALE_OF_EDGE = 5.0  # an object's scale is this times its cell's longest edge [1/m]
THINNEST = 0.020  # that the camera sees well and the fingers hold [m]


@dataclass(frozen=True, eq=False)
class EverydayObject:
    """An object with its mesh and the corners (N, 3) of the convex pieces that
    it collides as [m], about its centre of mass."""

    name: str
    mesh: TriangleMesh
    pieces: tuple[FloatArray, ...]

    @classmethod
    def centred(cls, name: str, mesh: TriangleMesh, pieces: Sequence[FloatArray]) -> EverydayObject:
        """Return an object of the merged pieces, all moved so that their common centre of mass is the origin."""
        pieces = merged(pieces)
        hulls = [ConvexHull(piece) for piece in pieces]
        volumes = np.array([hull.volume for hull in hulls])
        if not volumes.sum() > 0.0:
            raise SimulationError(f"{name} has no volume: its mesh is flat")
        middle = np.average([_middle(piece, hull) for piece, hull in zip(pieces, hulls)], axis=0, weights=volumes)
        return cls(name, mesh.transformed(Pose(np.eye(3), -middle)), tuple(piece - middle for piece in pieces))

    def sized(self, edge: float, share: float = 1.0) -> Shape:
        """Return the shape for a cell whose longest edge is `edge` [m]: scaled by five times that, but no longer than
        it, and a flat thing made thicker; `share` of that size where it must be smaller to be held."""
        extent = np.ptp(self.mesh.vertices, axis=0).astype(np.float64)
        scale = share * min(SCALE_OF_EDGE * edge, edge / float(extent.max()))
        scales = np.maximum(scale, np.minimum(THINNEST / extent, scale * 4.0))
        return Shape(
            self.name,
            self.mesh.transformed(scale=scales),
            Collision([HullPart(piece * scales) for piece in self.pieces]),
            MASS,
            friction=FRICTION,
            rolling_friction=ROLLING_FRICTION,
        )


def _middle(piece: FloatArray, hull: ConvexHull) -> FloatArray:
    """Return the centre of mass (3,) of a convex hull: the mean of its pyramids over the hull's faces."""
    inner = piece[hull.vertices].mean(axis=0)
    faces = piece[hull.simplices]
    volumes = np.abs(np.linalg.det(faces - inner))
    return np.asarray(np.average((faces.sum(axis=1) + inner) / 4.0, axis=0, weights=volumes))
