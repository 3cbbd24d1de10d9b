"""Shape of a kind of thing, made once and put into scenes as often as wished, and a thing in a scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from sim_bridge.colors import Rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision


@dataclass(frozen=True)
class Pinch:
    """Grasp of an upright thing, in its body frame: the middle between the jaws' contacts [m], the direction in which
    they close [rad] and how far apart they are then [m]."""

    x: float
    y: float
    yaw: float
    width: float


@dataclass(frozen=True, eq=False)
class Shape:
    """Geometry and physics of a kind of thing, in its body frame: z up as it is spawned.

    name: what sentences and results call it. collision: None for what is only seen. mass [kg]. symmetry: turned
    by this about z it is the same [rad]; 0 when every turn is. pinches: how parallel jaws hold it when it
    stands upright, best first; a thing without any is not to be grasped.
    """

    name: str
    mesh: TriangleMesh
    collision: Collision | None
    mass: float
    symmetry: float = math.tau
    friction: float = 1.0
    rolling_friction: float = 1e-4
    pinches: tuple[Pinch, ...] = ()

    @cached_property
    def footprint(self) -> npt.NDArray[np.float64]:
        """Convex outline on the table, (N, 2) [m, body frame], counter-clockwise."""
        hull = cv2.convexHull(self.mesh.vertices[:, :2].astype(np.float32), clockwise=False)
        return np.asarray(hull, dtype=np.float64).reshape(-1, 2)

    @cached_property
    def radius(self) -> float:
        """Distance from the body's axis to the farthest point of the footprint [m]."""
        return float(np.linalg.norm(self.footprint, axis=1).max())

    @cached_property
    def bottom(self) -> float:
        """Height of the underside in the body frame [m]."""
        return float(self.mesh.vertices[:, 2].min())


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One thing in a world: body is PyBullet's id, rgb 0..255 its colour where the mesh has none of its own.

    color: the colour's name in the benchmark, "" where it is not one of them.
    """

    shape: Shape
    color: str
    rgb: Rgb
    body: int
    fixed: bool

    @property
    def name(self) -> str:
        """Name of its kind, such as "block"."""
        return self.shape.name

    @property
    def mesh(self) -> TriangleMesh:
        """Triangles in the body frame."""
        return self.shape.mesh

    @property
    def described(self) -> str:
        """Colour and name, such as "red block"."""
        return f"{self.color} {self.name}".strip()
