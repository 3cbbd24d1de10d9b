"""What a renderer needs to know of a world, so that a snapshot of one serves as well."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from cliport_core import Pose
from sim_bridge.objects import SceneObject


class VisibleArm(Protocol):
    """The arm's links by name and index; poses in the base frame."""

    @property
    def link_indices(self) -> Mapping[str, int]: ...

    def link_pose(self, link: int) -> Pose: ...


class Visible(Protocol):
    """Objects and arm at `time` [s]; poses in the base frame."""

    @property
    def time(self) -> float: ...

    @property
    def objects(self) -> Sequence[SceneObject]: ...

    @property
    def panda(self) -> VisibleArm: ...

    def object_pose(self, thing: SceneObject) -> Pose: ...
