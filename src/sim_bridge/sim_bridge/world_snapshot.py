"""Poses of everything visible at one moment: enough to render while the world moves on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from cliport_core import Pose
from sim_bridge.objects import SceneObject
from sim_bridge.panda import PandaArm
from sim_bridge.world import SimWorld


class PandaSnapshot:
    """Link poses of the arm, by the names that PandaArm has for them."""

    def __init__(self, panda: PandaArm) -> None:
        self.link_indices: Mapping[str, int] = panda.link_indices
        self._poses = {index: panda.link_pose(index) for index in (-1, *panda.link_indices.values())}

    def link_pose(self, link: int) -> Pose:
        """Return the pose of a link's URDF frame in the base frame; link: its index, -1 for the base."""
        return self._poses[link]


class WorldSnapshot:
    """Poses of a world's objects and arm at `time` [s]; a camera can capture it as it would the world."""

    def __init__(self, world: SimWorld) -> None:
        self.time = world.time
        self.objects: Sequence[SceneObject] = world.objects
        self.panda = PandaSnapshot(world.panda)
        self._poses = {thing: world.object_pose(thing) for thing in self.objects}

    def object_pose(self, thing: SceneObject) -> Pose:
        """Return the pose of the object's centre in the base frame."""
        return self._poses[thing]
