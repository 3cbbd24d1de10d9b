"""The green corner mark into which a box is aligned."""

from __future__ import annotations

from cliport_core import Pose
from sim_bridge.colors import Rgb
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.shape import Shape

PURE_GREEN: Rgb = (0, 255, 0)
_LINE = 0.005  # width [m]
_LENGTH = 0.055  # [m]
_HEIGHT = 0.001  # [m]


def corner_shape(x: float, y: float) -> Shape:
    """Return two strips along the +x and the +y edge of a box of size x, y [m], meeting at its corner; only seen
    (docs/benchmark.md, "Objects"). The shape's frame is the middle of that box."""
    along = TriangleMesh.box((_LENGTH, _LINE, _HEIGHT))
    across = TriangleMesh.box((_LINE, _LENGTH, _HEIGHT))
    end_x, end_y = x / 2 + _LINE, y / 2 + _LINE
    mesh = TriangleMesh.joined(
        [
            along.transformed(Pose.from_xyz_rpy((end_x - _LENGTH / 2, end_y - _LINE / 2, 0.0), (0.0, 0.0, 0.0))),
            across.transformed(Pose.from_xyz_rpy((end_x - _LINE / 2, end_y - _LENGTH / 2, 0.0), (0.0, 0.0, 0.0))),
        ]
    )
    return Shape("green corner", mesh.colored(PURE_GREEN), None, mass=0.0)
