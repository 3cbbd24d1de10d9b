"""One goal of a task and its metric (docs/benchmark.md, "Scores")."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core import PlanarPose, Pose
from sim_bridge.objects import SceneObject
from sim_bridge.world import SimWorld

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

LATTICE = 0.02  # between the points of a thing that count in a zone [m]


@dataclass(frozen=True)
class PoseMetric:
    """Metric by pose: an object counts when it is nearer than `position` [m] in the plane to a target that is allowed
    for it, and turned less than `rotation` [rad] from it, up to its symmetry; heights do not count."""

    position: float = 0.01
    rotation: float = math.radians(15.0)


@dataclass(frozen=True, eq=False)
class ZoneMetric:
    """Metric by share: that of the objects' points inside a box of size (x, y) [m] about the target, below z_cap [m] in
    the target's frame. points: of each object (N, 3) [m, body frame]. about: pose of the box, if it is not at the
    targets."""

    size: tuple[float, float]
    points: tuple[FloatArray, ...]
    z_cap: float = 0.30
    about: Pose | None = None


@dataclass(frozen=True, eq=False)
class Goal:
    """Some objects at some targets, asked for by one sentence.

    matches: (objects, targets) which may go where. max_reward: its share of the task. symmetries: of each object
    [rad], 0: its yaw does not count. turn: whether the expert turns objects to their targets' yaw. replace:
    whether the expert also moves what already lies right. name of the target for people.
    """

    sentence: str
    objects: tuple[SceneObject, ...]
    targets: tuple[Pose, ...]
    matches: BoolArray
    metric: PoseMetric | ZoneMetric
    max_reward: float
    symmetries: tuple[float, ...] = ()
    turn: bool = True
    replace: bool = False
    target_name: str = "target"

    def value(self, world: SimWorld) -> float:
        """Return the share of this goal that is reached, 0..1."""
        if isinstance(self.metric, PoseMetric):
            return float(np.mean(self.matched(world).any(axis=1)))
        inside = [self._inside(world, i) for i in range(len(self.objects))]
        return sum(int(i.sum()) for i in inside) / sum(len(i) for i in inside)

    def reached(self, world: SimWorld) -> bool:
        """Return True if less than a hundredth of the task is missing (docs/benchmark.md, "Scores")."""
        return self.max_reward * (1.0 - self.value(world)) < 0.01

    def matched(self, world: SimWorld) -> BoolArray:
        """Return (objects, targets): True where the object lies at that target
        and is allowed there, by the pose test."""
        metric = self.metric if isinstance(self.metric, PoseMetric) else PoseMetric()
        poses = [world.planar_pose(thing) for thing in self.objects]
        targets = [PlanarPose.from_pose(target) for target in self.targets]
        at = np.array([(p.x, p.y) for p in poses])
        wanted = np.array([(t.x, t.y) for t in targets])
        near = np.linalg.norm(at[:, None] - wanted[None], axis=-1) < metric.position
        for i, symmetry in enumerate(self.symmetries):
            if symmetry > 0.0:
                turns = [abs(math.remainder(poses[i].yaw - t.yaw, symmetry)) < metric.rotation for t in targets]
                near[i] &= np.array(turns)
        matched: BoolArray = near & self.matches
        return matched

    def level(self, thing: SceneObject) -> float:
        """Return the height [m] on which a thing will lie at the lowest target that is allowed for it."""
        allowed = np.flatnonzero(self.matches[self.objects.index(thing)])
        return min(float(self.targets[j].translation[2]) for j in allowed) + thing.shape.bottom

    def allows(self, thing: SceneObject, x: float, y: float) -> bool:
        """Return True if the object's origin, put at x, y [m], would be right for one of its targets."""
        reach = self.metric.position if isinstance(self.metric, PoseMetric) else 0.0
        for j in np.flatnonzero(self.matches[self.objects.index(thing)]):
            if isinstance(self.metric, ZoneMetric):
                local = (self.metric.about or self.targets[j]).inverse().apply(np.array([[x, y, 0.0]]))[0]
                if abs(local[0]) < self.metric.size[0] / 2 and abs(local[1]) < self.metric.size[1] / 2:
                    return True
            elif math.hypot(*(self.targets[j].translation[:2] - (x, y))) < reach:
                return True
        return False

    def _inside(self, world: SimWorld, i: int) -> BoolArray:
        """Return (N,) which points of an object lie in the zone of any target that is allowed for it."""
        metric = self.metric
        assert isinstance(metric, ZoneMetric)
        points = world.object_pose(self.objects[i]).apply(metric.points[i])
        inside = np.zeros(len(points), dtype=bool)
        for j in np.flatnonzero(self.matches[i]):
            local = (metric.about or self.targets[j]).inverse().apply(points)
            inside |= (np.abs(local[:, :2]) < np.array(metric.size) / 2).all(axis=1) & (local[:, 2] < metric.z_cap)
        return inside


def lattice(low: npt.ArrayLike, size: npt.ArrayLike) -> FloatArray:
    """Return points (N, 3) every 2 cm in a box of `size` (3,) from the
    corner `low` (3,) [m], the far faces excluded."""
    start, extent = np.asarray(low, dtype=np.float64), np.asarray(size, dtype=np.float64)
    axes = [start[i] + np.arange(0.0, max(extent[i], 1e-6), LATTICE) for i in range(3)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
