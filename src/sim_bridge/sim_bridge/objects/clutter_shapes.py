"""Shapes that no task has and no sentence names, for clutter."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from cliport_core import Pose
from sim_bridge.colors import Rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision, CylinderPart
from sim_bridge.objects.shape import Shape

# none is near a colour of the benchmark
CLUTTER_PAINTS: tuple[Rgb, ...] = ((22, 24, 28), (18, 40, 90), (88, 92, 24), (122, 16, 74), (0, 92, 92), (70, 38, 120))

_FRICTION = 0.8
_SEGMENTS = 24


@lru_cache(maxsize=1)
def clutter_shapes() -> tuple[Shape, ...]:
    """Return a tin, a slab like a telephone, a six-sided bar, a wedge and a domino; all lie as they are spawned."""
    return (
        _tin("tin", 0.022, 0.045),
        _prism("slab", [(0.035, 0.06), (-0.035, 0.06), (-0.035, -0.06), (0.035, -0.06)], 0.009, 0.12),
        _prism("bar", _bar(0.05, 0.009), 0.018, 0.03),
        _wedge("wedge", (0.06, 0.035, 0.03)),
        _prism("domino", [(0.012, 0.024), (-0.012, 0.024), (-0.012, -0.024), (0.012, -0.024)], 0.014, 0.02),
    )


def _bar(half_length: float, half_width: float) -> list[tuple[float, float]]:
    """Return a long hexagon [m]."""
    shoulder = half_length - half_width
    return [
        (half_length, 0.0),
        (shoulder, half_width),
        (-shoulder, half_width),
        (-half_length, 0.0),
        (-shoulder, -half_width),
        (shoulder, -half_width),
    ]


def _prism(name: str, outline: list[tuple[float, float]], height: float, mass: float) -> Shape:
    """Return an outline [m] that stands `height` tall, its frame in its middle."""
    ends = [[x, y, z] for z in (-height / 2, height / 2) for x, y in outline]
    mesh = TriangleMesh.extruded(outline, height)
    low = float(mesh.vertices[:, 2].min())
    centred = mesh.transformed(Pose(np.eye(3), np.array([0.0, 0.0, -height / 2 - low])))
    return Shape(name, centred, Collision.hull(ends), mass, friction=_FRICTION)


def _tin(name: str, radius: float, height: float) -> Shape:
    """Return an upright cylinder [m], its frame in its middle."""
    angles = np.arange(_SEGMENTS) * (math.tau / _SEGMENTS)
    ring = [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
    round_body = Collision((CylinderPart(radius, height, Pose.identity()),))
    mesh = _prism(name, ring, height, 0.0).mesh
    return Shape(name, mesh, round_body, 0.06, symmetry=0.0, friction=_FRICTION)


def _wedge(name: str, size: tuple[float, float, float]) -> Shape:
    """Return a door stop: rising along x over `size` [m], its frame in the middle of the box around it."""
    x, y, z = (edge / 2 for edge in size)
    corners = np.array([[-x, -y, -z], [x, -y, -z], [x, -y, z], [-x, y, -z], [x, y, -z], [x, y, z]])
    faces = [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [0, 2, 5], [0, 5, 3]]
    mesh = TriangleMesh(corners.astype(np.float32), np.array(faces, dtype=np.int32))
    return Shape(name, mesh, Collision.hull(corners), 0.03, friction=_FRICTION)
