"""Three tiles in a row along y, light, middle and dark brown: the body of a stand."""

from __future__ import annotations

from cliport_core import Pose
from sim_bridge.colors import Rgb, rgb
from sim_bridge.geometry.mesh import TriangleMesh

LIGHT_BROWN: Rgb = (234, 175, 143)
DARK_BROWN: Rgb = (78, 58, 48)


def tile_row(edge: float, height: float) -> TriangleMesh:
    """Return square tiles [m] side by side, the lightest at -y, the row's middle at the origin."""
    tile = TriangleMesh.box((edge, edge, height))
    tones = ((-edge, LIGHT_BROWN), (0.0, rgb("brown")), (edge, DARK_BROWN))
    return TriangleMesh.joined(
        [tile.transformed(Pose.from_xyz_rpy((0.0, y, 0.0), (0.0, 0.0, 0.0))).colored(tone) for y, tone in tones]
    )
