"""The part of a world that a renderer needs, so that a snapshot serves as well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from cliport_core import Pose
from sim_bridge.objects import SceneObject


class VisibleArm(Protocol):
    """The arm's links by name and index; poses in the base frame."""

    @property
    def link_indices(self) -> Mapping[str, int]:
        """The links' indices by name."""
        ...

    def link_pose(self, link: int) -> Pose:
        """Return the pose of a link's URDF frame in the base frame."""
        ...


class Visible(Protocol):
    """Objects and arm at `time` [s]; poses in the base frame."""

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...

    @property
    def objects(self) -> Sequence[SceneObject]:
        """Objects in the order in which they were added."""
        ...

    @property
    def panda(self) -> VisibleArm:
        """The arm."""
        ...

    def object_pose(self, thing: SceneObject) -> Pose:
        """Return the pose of the object's centre in the base frame."""
        ...
