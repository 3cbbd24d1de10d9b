"""The distance of planned motions from the simulator's own bodies, and those bodies as a cloud without a gap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import cast

import numpy as np
import numpy.typing as npt
import pybullet
from arm_room import set_arm

from cliport_core import Pose, WorkspaceSpec
from panda_executor.model import PandaModel
from panda_executor.motions import Motion
from panda_executor.scene import SceneConfig, place_camera
from panda_executor.transfer_attempts import PickPlacePlan
from sim_bridge.objects import SceneObject
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.objects.collision import BoxPart
from sim_bridge.robot import HAND, ROBOT
from sim_bridge.world import SimWorld

FloatArray = npt.NDArray[np.float64]

PERIOD = 0.001  # of the arm's controller [s]
FAR = 0.2  # distances are measured up to this [m]
AMPLE = 0.1  # and this is what matters of them [m]
LEVER = 1.25  # no point of arm or load is farther from a joint's axis [m]
TABLE = 0  # body of the world's slab
# What may touch, and does not count:
STANDS = 0.001  # the block on the table when it is raised, as deep as contacts are solved [m]
GRASPING = ("hand", "leftfinger", "rightfinger")  # and the block, from the descent until the hand has left it


@dataclass(frozen=True)
class Touch:
    """Two bodies that meet: in which motion, after how long [s], how deep at worst [m], the tcp (3,) [m] then."""

    motion: str
    first: str
    second: str
    time: float
    depth: float
    tcp: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class _Part:
    """One motion as it is looked at. load: the block in the tcp's frame while it is held, else None."""

    name: str
    motion: Motion
    load: Pose | None
    grasping: bool
    rises: bool = False


class TrueGeometry:
    """Sets the world's arm to the configurations of a plan, and measures how far it is from everything.

    Configurations between which the arm cannot have come nearer than the nearest so far are left out: the result is
    that of looking at every millisecond.
    """

    def __init__(self, world: SimWorld, block: SceneObject, cameras: Sequence[FloatArray] = ()) -> None:
        """cameras: where they stand, (3,) [m, base frame] each; they and their posts are bodies, too."""
        self._world, self._block, self._arm, self._cameras = world, block, world.panda, cameras
        self._posts: list[tuple[int, str]] = []
        names = {index: name.removeprefix(ROBOT.prefix) for name, index in self._arm.link_indices.items()}
        self._links = {**names, -1: "link0"}
        self.looked_at = 0

    def check(self, plan: PickPlacePlan) -> tuple[float, float, list[Touch]]:
        """Return the least distance to things and that to the table [m], AMPLE at most, and all touches.

        The block ends where the plan puts it.
        """
        before = self._world.object_pose(self._block)
        self._pose(plan.descend.trajectory.end, plan.descend.scene.hand.width)
        load = _centred(self._arm.tcp_in_base().inverse() @ before)
        parts = (
            _Part("go above", plan.go_above, None, False),
            _Part("descend", plan.descend, None, True),
            _Part("raise", plan.raise_up, load, True, rises=True),
            _Part("carry", plan.carry, load, True),
            _Part("lower", plan.lower, load, True),
            _Part("leave", plan.leave, None, True),
            _Part("retreat", plan.retreat, None, False),
        )
        nearest, touches = np.array([AMPLE, AMPLE]), list[Touch]()
        self._posts = _camera_bodies(self._world, self._cameras)
        for part in parts:
            self._follow(part, nearest, touches)
        for body, _ in self._posts:
            pybullet.removeBody(body, physicsClientId=self._world.client)
        return float(nearest[0]), float(nearest[1]), touches

    def _follow(self, part: _Part, nearest: FloatArray, touches: list[Touch]) -> None:
        trajectory = part.motion.trajectory
        times = np.append(np.arange(0.0, trajectory.duration, PERIOD), trajectory.duration)
        positions = trajectory.sample(times)[0]
        turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(positions, axis=0)).sum(axis=1))])
        worst: dict[tuple[str, str], Touch] = {}
        index = 0
        while index < len(times):
            self._pose(positions[index], part.motion.scene.hand.width)
            if part.load is not None:
                self._world.move_object(self._block, self._arm.tcp_in_base() @ part.load)
            found = self._distances(part)
            self.looked_at += 1
            for (first, second), distance in found.items():
                known = worst.get((first, second))
                if distance <= 0.0 and (known is None or distance < known.depth):
                    tcp = tuple(np.round(self._arm.tcp_in_base().translation, 3).tolist())
                    worst[first, second] = Touch(part.name, first, second, float(times[index]), distance, tcp)
            now = _nearest(found)
            np.minimum(nearest, now, out=nearest)
            spare = float((now - nearest).min()) / LEVER
            index = max(index + 1, int(np.searchsorted(turned, turned[index] + spare)))
        touches += worst.values()

    def _pose(self, positions: FloatArray, width: float | None) -> None:
        set_arm(self._world, positions, HAND.opening if width is None else width)

    def _distances(self, part: _Part) -> dict[tuple[str, str], float]:
        """Return the distance [m] of each pair that is nearer than FAR and is not meant to touch."""
        found: dict[tuple[str, str], float] = {}
        for body, name in self._bodies():
            for point in pybullet.getClosestPoints(self._arm.body, body, FAR, physicsClientId=self._world.client):
                link = self._links[point[3]]
                meant = part.grasping and body == self._block.body and link in GRASPING
                stands = body == TABLE and link in ("link0", "link1")
                if not meant and not stands:
                    found[link, name] = min(found.get((link, name), FAR), float(point[8]))
            if part.load is not None and body != self._block.body:
                for point in pybullet.getClosestPoints(self._block.body, body, FAR, physicsClientId=self._world.client):
                    stands = part.rises and body == TABLE and point[8] > -STANDS
                    if not stands:
                        found["block", name] = min(found.get(("block", name), FAR), float(point[8]))
        return found

    def _bodies(self) -> list[tuple[int, str]]:
        things = [(thing.body, thing.name) for thing in self._world.objects]
        return [(TABLE, "table"), *things, *self._posts]


def _camera_bodies(world: SimWorld, cameras: Sequence[FloatArray]) -> list[tuple[int, str]]:
    """Add cameras and posts of the executor's sizes to the world; return the bodies with their names."""
    boxes: list[tuple[str, FloatArray, FloatArray]] = []
    model = SimpleNamespace(link=str, put_fixed_box=lambda name, size, at, *rest: boxes.append((name, size, at)))
    for number, camera in enumerate(cameras):
        place_camera(cast(PandaModel, model), SceneConfig(), camera, number + 1)
    bodies = []
    for name, size, at in boxes:
        half = (np.asarray(size) / 2.0).tolist()
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=world.client)
        body = pybullet.createMultiBody(0.0, shape, -1, np.asarray(at).tolist(), physicsClientId=world.client)
        bodies.append((int(body), name))
    return bodies


def _centred(load: Pose) -> Pose:
    """Return the block in the tcp's frame once the fingers, which close along y, have it between them."""
    x, _, z = load.translation
    return Pose(load.rotation, np.array([x, 0.0, z]))


def _nearest(found: dict[tuple[str, str], float]) -> FloatArray:
    """Return the least distance to things and to the table [m], (2,)."""
    table = [distance for (_, second), distance in found.items() if second == "table"]
    things = [distance for (_, second), distance in found.items() if second != "table"]
    return np.array([min(things, default=FAR), min(table, default=FAR)])


def true_cloud(world: SimWorld, workspace: WorkspaceSpec, step: float = 0.0025) -> npt.NDArray[np.float32]:
    """Return what is highest over each place of the workspace and around it, (N, 3) [m, base frame]."""
    border = 0.12
    x, y = np.meshgrid(
        np.arange(workspace.x_min - border, workspace.x_max + border, step) + step / 2,
        np.arange(workspace.y_min - border, workspace.y_max + border, step) + step / 2,
    )
    z = np.zeros_like(x)
    for thing in world.objects:
        assert thing.shape.collision is not None
        pose = world.object_pose(thing)
        for part in thing.shape.collision.parts:
            assert isinstance(part, BoxPart)
            at = pose @ part.pose
            yaw = math.atan2(at.rotation[1, 0], at.rotation[0, 0])
            dx, dy = x - at.translation[0], y - at.translation[1]
            along, across = dx * math.cos(yaw) + dy * math.sin(yaw), dy * math.cos(yaw) - dx * math.sin(yaw)
            # a cell that is covered in part counts
            over = (np.abs(along) < part.size[0] / 2 + step) & (np.abs(across) < part.size[1] / 2 + step)
            margin = over if thing.name != "block" else over & (np.maximum(abs(along), abs(across)) < BLOCK_SIZE / 2)
            z[margin] = np.maximum(z[margin], at.translation[2] + part.size[2] / 2)
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]).astype(np.float32)
