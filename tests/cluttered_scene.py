"""Scenes of boxes, columns and shelves around a block and the place where it is to go, each drawn from its seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pybullet
from arm_room import ArmRoom

from cliport_core import PlanarPose, Pose
from cliport_core.action import PickPlaceAction
from panda_executor.ik import HandDownIk
from panda_model import load_preset
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import SceneObject, Shape
from sim_bridge.objects.block import BLOCK_SIZE, block_shape
from sim_bridge.objects.collision import BoxPart, Collision
from sim_bridge.rendering.mounting import load_camera
from sim_bridge.world import SimWorld

HAND = load_preset().hand
CAMERA = load_camera().camera_in_base
GRASP_ROOM = 0.03  # around the open hand above pick and place, up to any height, in which nothing stands [m]
ARM_ROOM = 0.06  # around the arm where it grasps and lets go, in one way of several at least [m]
START_ROOM = 0.06  # around the arm at its ready pose [m]
APART = 0.01  # between two things [m]
WAY = 0.2  # from pick to place at least [m]
SEEN = 0.03  # around pick and place no line of sight is blocked [m]
_SLENDER, _BOARD = 0.015, 0.015  # thickness of a shelf's legs and board [m]
_TRIES = 200

Random = np.random.Generator
Draw = Callable[[Random], Shape]


@dataclass(frozen=True, eq=False)
class ClutteredScene:
    """A block, what is to be done with it, and the things that stand around."""

    block: SceneObject
    action: PickPlaceAction
    things: tuple[SceneObject, ...]


def standing(name: str, parts: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> Shape:
    """Return a thing of boxes, each with its edges (x, y, z) and its middle [m], the frame on the table."""
    at = [(size, Pose(np.eye(3), np.array(middle))) for size, middle in parts]
    mesh = TriangleMesh.joined([TriangleMesh.box(size).transformed(pose) for size, pose in at])
    return Shape(name, mesh, Collision(tuple(BoxPart(size, pose) for size, pose in at)), 1.0)


def _box(random: Random) -> Shape:
    x, y, z = random.uniform([0.04, 0.04, 0.05], [0.14, 0.14, 0.25])
    return standing("box", [((x, y, z), (0.0, 0.0, z / 2))])


def _column(random: Random) -> Shape:
    edge, z = random.uniform([0.03, 0.2], [0.07, 0.45])
    return standing("column", [((edge, edge, z), (0.0, 0.0, z / 2))])


def _shelf(random: Random) -> Shape:
    x, y, z = random.uniform([0.08, 0.15, 0.1], [0.14, 0.3, 0.25])
    side = (y - _SLENDER) / 2
    legs = [((x, _SLENDER, z - _BOARD), (0.0, sign * side, (z - _BOARD) / 2)) for sign in (-1.0, 1.0)]
    return standing("shelf", [((x, y, _BOARD), (0.0, 0.0, z - _BOARD / 2)), *legs])


def make_scene(world: SimWorld, ik: HandDownIk, seed: int) -> ClutteredScene:
    """Empty the world, put a block and three to six things into it, and say where the block is to go."""
    random = np.random.default_rng([2026, seed])
    world.clear()
    arm = ArmRoom(world, ik, action := _action(random), ARM_ROOM)
    while not arm.is_reached():
        arm = ArmRoom(world, ik, action := _action(random), ARM_ROOM)
    block = world.add(block_shape(), action.pick.as_pose(BLOCK_SIZE / 2), "red")
    rooms = [_grasp_room(world, pose) for pose in (action.pick, action.place)]
    things: list[SceneObject] = []
    for _ in range(int(random.integers(3, 7))):
        draw: Draw = (_box, _column, _shelf)[int(random.integers(3))]
        thing = _placed(world, draw, action, arm, rooms, things, random)
        if thing is not None:
            things.append(thing)
    for room in rooms:
        pybullet.removeBody(room, physicsClientId=world.client)
    return ClutteredScene(block, action, tuple(things))


def without_things(world: SimWorld, scene: ClutteredScene) -> None:
    """Take away all but the block."""
    for thing in scene.things:
        world.remove(thing)


def _action(random: Random) -> PickPlaceAction:
    while True:
        (a, b, yaw), (c, d, turned) = random.uniform([0.35, -0.3, -math.pi / 2], [0.6, 0.3, math.pi / 2], (2, 3))
        if math.hypot(a - c, b - d) > WAY:
            return PickPlaceAction(PlanarPose(a, b, yaw), PlanarPose(c, d, turned))


def _grasp_room(world: SimWorld, at: PlanarPose) -> int:
    """Return a body as large as the hand, and as high as anything: the jaws close along its x axis."""
    half = [HAND.palm_half_length, HAND.palm_half_width, 0.5]
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=world.client)
    pose = at.as_pose(0.5)
    body: int = pybullet.createMultiBody(
        0.0, shape, -1, pose.translation.tolist(), pose.as_quaternion_xyzw().tolist(), physicsClientId=world.client
    )
    pybullet.setCollisionFilterGroupMask(body, -1, 0, 0, physicsClientId=world.client)  # rays pass through it
    return body


def _placed(
    world: SimWorld,
    draw: Draw,
    action: PickPlaceAction,
    arm: ArmRoom,
    rooms: list[int],
    things: list[SceneObject],
    random: Random,
) -> SceneObject | None:
    """Add a thing beside, behind or between pick and place; None where no free place was drawn."""
    for _ in range(_TRIES):
        thing = world.add(draw(random), _around(action, random).as_pose(), paint=(90, 90, 110), fixed=True)
        bodies = [(room, GRASP_ROOM) for room in rooms] + [(other.body, APART) for other in things]
        bodies.append((world.panda.body, START_ROOM))
        inside = world.config.workspace.contains(thing.shape.footprint @ _turn(world, thing) + world.object_xy(thing))
        free = bool(inside.all()) and not any(_near(world, thing.body, body, room) for body, room in bodies)
        seen = free and all(_is_seen(world, at) for at in (action.pick, action.place))
        if seen and arm.allow(thing.body):
            return thing
        world.remove(thing)
    return None


def _around(action: PickPlaceAction, random: Random) -> PlanarPose:
    """Draw a place beside pick or place, between the robot and one of them, or between both; and a yaw."""
    ends = (action.pick, action.place)
    near = ends[int(random.integers(2))]
    yaw = float(random.uniform(-math.pi, math.pi))
    role = int(random.integers(3))
    if role == 0:  # beside
        side = 1.0 if random.random() < 0.5 else -1.0
        dx, dy = random.uniform([-0.08, 0.08], [0.08, 0.25])
        return PlanarPose(near.x + dx, near.y + side * dy, yaw)
    if role == 1:  # behind, as the camera sees it
        dx, dy = random.uniform([0.05, -0.12], [0.25, 0.12])
        return PlanarPose(near.x - dx, near.y + dy, yaw)
    share, dx, dy = random.uniform([0.2, -0.06, -0.06], [0.8, 0.06, 0.06])
    x = action.pick.x + share * (action.place.x - action.pick.x) + dx
    return PlanarPose(x, action.pick.y + share * (action.place.y - action.pick.y) + dy, yaw)


def _turn(world: SimWorld, thing: SceneObject) -> npt.NDArray[np.float64]:
    turn: npt.NDArray[np.float64] = world.object_pose(thing).rotation[:2, :2].T
    return turn


def _near(world: SimWorld, body: int, other: int, room: float) -> bool:
    return bool(pybullet.getClosestPoints(body, other, room, physicsClientId=world.client))


def _is_seen(world: SimWorld, at: PlanarPose) -> bool:
    """Return True if the camera sees the table's surface at a place, and the top of a block there."""
    camera = CAMERA.translation.tolist()
    ends = [
        [at.x + dx, at.y + dy, z]
        for dx in (-SEEN, 0.0, SEEN)
        for dy in (-SEEN, 0.0, SEEN)
        for z in (0.002, BLOCK_SIZE + 0.002)
    ]
    blocked = {hit[0] for hit in pybullet.rayTestBatch([camera] * len(ends), ends, physicsClientId=world.client)}
    fixed = {thing.body for thing in world.objects if thing.fixed}
    return not blocked & fixed
