"""The arm's coarse meshes, as the renderer shows it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import pybullet_data

from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.robot import ROBOT

_PARTS = (*(f"link{i}" for i in range(8)), "hand")


@lru_cache(maxsize=1)
def panda_meshes() -> dict[str, TriangleMesh]:
    """Return the meshes by link name, each in its link's frame."""
    folder = Path(pybullet_data.getDataPath()) / "franka_panda" / "meshes" / "collision"
    meshes = {f"{ROBOT.prefix}{name}": TriangleMesh.from_obj(folder / f"{name}.obj") for name in _PARTS}
    finger = TriangleMesh.from_obj(folder / "finger.obj")
    meshes[f"{ROBOT.prefix}leftfinger"] = finger
    # the right finger is the left one turned half round about z
    meshes[f"{ROBOT.prefix}rightfinger"] = finger.transformed(scale=(-1.0, -1.0, 1.0))
    return meshes
