"""Collision shapes: convex parts, made into one body of PyBullet."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from cliport_core import Pose
from sim_bridge.bullet import pybullet
from sim_bridge.errors import SimulationError

MAX_PRIMITIVES = 16  # that PyBullet allows in one compound
HULL_PADDING = 0.001  # that PyBullet adds around a convex hull, not around boxes and cylinders [m]


@dataclass(frozen=True)
class BoxPart:
    """A box of `size` (x, y, z) [m], its middle at `pose` in the body frame."""

    size: tuple[float, float, float]
    pose: Pose

    @cached_property
    def corners(self) -> npt.NDArray[np.float64]:
        """Corners of the box, (8, 3) [m, body frame], read-only."""
        signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
        return _read_only(self.pose.apply(signs * self.size))


@dataclass(frozen=True)
class CylinderPart:
    """An upright cylinder, its middle at `pose` in the body frame [m]."""

    radius: float
    height: float
    pose: Pose

    @cached_property
    def corners(self) -> npt.NDArray[np.float64]:
        """Corners of a prism of twelve sides around it, (24, 3) [m, body frame], read-only."""
        angles = np.arange(12) * (np.pi / 6)
        ring = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * (self.radius / np.cos(np.pi / 12))
        ends = [np.column_stack([ring, np.full(12, z)]) for z in (-self.height / 2, self.height / 2)]
        return _read_only(self.pose.apply(np.concatenate(ends)))


@dataclass(frozen=True, eq=False)
class HullPart:
    """The convex hull of vertices (N, 3) [m] in the body frame."""

    vertices: npt.NDArray[np.float64]

    @property
    def corners(self) -> npt.NDArray[np.float64]:
        """Vertices of the hull, (N, 3) [m, body frame]."""
        return self.vertices


PrimitivePart = BoxPart | CylinderPart


@dataclass(frozen=True, eq=False)
class Collision:
    """Parts of one kind: at most 16 boxes and cylinders, or any number of convex hulls.

    Raises:
        SimulationError: on a mixture, or on too many primitives.
    """

    parts: Sequence[PrimitivePart] | Sequence[HullPart]

    def __post_init__(self) -> None:
        hulls = sum(isinstance(part, HullPart) for part in self.parts)
        if not self.parts or hulls not in (0, len(self.parts)):
            raise SimulationError("a collision shape needs parts that are all hulls or all boxes and cylinders")
        if hulls == 0 and len(self.parts) > MAX_PRIMITIVES:
            raise SimulationError(f"a collision shape may have {MAX_PRIMITIVES} primitives, got {len(self.parts)}")

    @classmethod
    def box(cls, size: tuple[float, float, float]) -> Collision:
        """Return one box about the origin."""
        return cls((BoxPart(size, Pose.identity()),))

    @classmethod
    def hull(cls, vertices: npt.ArrayLike) -> Collision:
        """Return one convex hull of vertices (N, 3) [m]."""
        return cls((HullPart(np.asarray(vertices, dtype=np.float64)),))

    def create(self, client: int) -> int:
        """Create a collision shape in a client and return PyBullet's id."""
        hulls = [part for part in self.parts if isinstance(part, HullPart)]
        return _create_hulls(client, hulls) if hulls else _create_primitives(client, self.parts)


def _read_only(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    points.flags.writeable = False
    return points


def _create_primitives(client: int, parts: Sequence[PrimitivePart] | Sequence[HullPart]) -> int:
    types, half_extents, radii, lengths, positions, orientations = [], [], [], [], [], []
    for part in parts:
        assert not isinstance(part, HullPart)
        box = isinstance(part, BoxPart)
        types.append(pybullet.GEOM_BOX if box else pybullet.GEOM_CYLINDER)
        half_extents.append([s / 2 for s in part.size] if isinstance(part, BoxPart) else [0.0, 0.0, 0.0])
        radii.append(0.0 if isinstance(part, BoxPart) else part.radius)
        lengths.append(0.0 if isinstance(part, BoxPart) else part.height)
        positions.append(part.pose.translation.tolist())
        orientations.append(part.pose.as_quaternion_xyzw().tolist())
    shape: int = pybullet.createCollisionShapeArray(
        shapeTypes=types,
        halfExtents=half_extents,
        radii=radii,
        lengths=lengths,
        collisionFramePositions=positions,
        collisionFrameOrientations=orientations,
        physicsClientId=client,
    )
    return shape


def _create_hulls(client: int, hulls: Sequence[HullPart]) -> int:
    """Create a shape through a Wavefront file, each of whose objects becomes one convex part of the body."""
    lines: list[str] = []
    count = 1
    for i, part in enumerate(hulls):
        hull = ConvexHull(part.vertices)
        lines.append(f"o part{i}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in part.vertices]
        lines += ["f " + " ".join(str(count + v) for v in face) for face in hull.simplices.tolist()]
        count += len(part.vertices)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hulls.obj"
        path.write_text("\n".join(lines) + "\n")
        shape: int = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(path), physicsClientId=client)
    return shape
