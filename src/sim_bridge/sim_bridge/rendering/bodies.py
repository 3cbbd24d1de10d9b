"""The things and links that a camera may see, each where it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cliport_core import Pose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.rendering.appearance import Appearance
from sim_bridge.rendering.panda_meshes import panda_meshes
from sim_bridge.rendering.visible import Visible
from sim_bridge.robot import ROBOT


class Body(NamedTuple):
    """A mesh in the base frame; rgb 0..255 where the mesh has no colours of its own."""

    mesh: TriangleMesh
    pose: Pose
    rgb: Sequence[float]

    @property
    def box(self) -> npt.NDArray[np.float32]:
        """The corners (8, 3) of a box about it [m], base frame."""
        return self.pose.apply(self.mesh.box_corners).astype(np.float32)

    @property
    def outline(self) -> npt.NDArray[np.float32]:
        """Points (K, 3) with the same convex hull [m], base frame."""
        return self.pose.apply(self.mesh.hull).astype(np.float32)


def bodies_of(world: Visible, appearance: Appearance) -> list[Body]:
    """Return the world's things, then the arm's links, as they are now."""
    bodies = [Body(thing.mesh, world.object_pose(thing), thing.rgb) for thing in world.objects]
    for link, mesh in panda_meshes().items():
        index = -1 if link == ROBOT.base_frame else world.panda.link_indices[link]
        bodies.append(Body(mesh, world.panda.link_pose(index), appearance.robot_rgb))
    return bodies
