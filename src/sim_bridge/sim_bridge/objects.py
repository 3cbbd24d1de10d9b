"""Blocks and bowls: their shape, mass and friction in physics, and the same shape for the renderer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache

import numpy as np

from cliport_perception import Pose
from sim_bridge.bullet import pybullet
from sim_bridge.mesh import TriangleMesh

BLOCK_SIZE = 0.04  # edge [m]
BLOCK_MASS = 0.03  # [kg]
BOWL_RADIUS = 0.057  # outer, at the rim [m]
BOWL_BASE_RADIUS = 0.050  # outer, at the table [m]
BOWL_HEIGHT = 0.035  # [m]
BOWL_FLOOR = 0.008  # thickness [m]
BOWL_WALL = 0.005  # thickness [m]
BOWL_MASS = 0.12  # of a bowl that can move [kg]

_FRICTION = 1.0
_WALL_PIECES = 15  # with the floor as many pieces as PyBullet allows in one compound shape


class Kind(Enum):
    """What an object is."""

    BLOCK = "block"
    BOWL = "bowl"


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One object in the world: body is PyBullet's id; its frame lies at its geometric centre."""

    kind: Kind
    color: str
    body: int
    fixed: bool
    mesh: TriangleMesh


@lru_cache(maxsize=1)
def block_mesh() -> TriangleMesh:
    """The cube."""
    return TriangleMesh.box((BLOCK_SIZE, BLOCK_SIZE, BLOCK_SIZE))


@lru_cache(maxsize=1)
def bowl_mesh() -> TriangleMesh:
    """The bowl, its frame on its axis at half its height."""
    low, rim, floor = -BOWL_HEIGHT / 2, BOWL_HEIGHT / 2, -BOWL_HEIGHT / 2 + BOWL_FLOOR
    inner_floor = _outer_radius(BOWL_FLOOR) - BOWL_WALL
    profile = [
        (0.0, low),
        (BOWL_BASE_RADIUS, low),
        (BOWL_RADIUS, rim),
        (BOWL_RADIUS - BOWL_WALL, rim),
        (inner_floor, floor),
        (0.0, floor),
    ]
    return TriangleMesh.revolved(profile, segments=48)


def spawn_block(client: int, color: str, x: float, y: float, yaw: float) -> SceneObject:
    """A free cube resting on the table at x, y [m], turned by yaw [rad]."""
    half = BLOCK_SIZE / 2
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[half, half, half], physicsClientId=client)
    pose = Pose.from_xyz_rpy((x, y, half), (0.0, 0.0, yaw))
    body = _create_body(client, shape, BLOCK_MASS, pose)
    return SceneObject(Kind.BLOCK, color, body, False, block_mesh())


def spawn_bowl(client: int, color: str, x: float, y: float, yaw: float, fixed: bool) -> SceneObject:
    """A bowl on the table at x, y [m]; a fixed one never moves."""
    pose = Pose.from_xyz_rpy((x, y, BOWL_HEIGHT / 2), (0.0, 0.0, yaw))
    body = _create_body(client, _bowl_collision(client), 0.0 if fixed else BOWL_MASS, pose)
    return SceneObject(Kind.BOWL, color, body, fixed, bowl_mesh())


def _outer_radius(height: float) -> float:
    """Radius [m] of the outside at a height [m] above the bowl's underside."""
    return BOWL_BASE_RADIUS + (BOWL_RADIUS - BOWL_BASE_RADIUS) * height / BOWL_HEIGHT


def _bowl_collision(client: int) -> int:
    """Leaning wall boxes in a ring, and a disc for the floor."""
    lean = math.atan2(BOWL_RADIUS - BOWL_BASE_RADIUS, BOWL_HEIGHT)
    wall_height = BOWL_HEIGHT / math.cos(lean) - BOWL_WALL * math.tan(lean)
    # the boxes' corners, not their middles, touch the round outline: then nothing sticks out of what is seen
    flat = math.cos(math.pi / _WALL_PIECES)
    middle = (BOWL_BASE_RADIUS + BOWL_RADIUS) / 2 * flat - BOWL_WALL / 2 / math.cos(lean)
    width = 2 * (BOWL_RADIUS * flat) * math.tan(math.pi / _WALL_PIECES)
    half_extents = [[BOWL_WALL / 2, width / 2, wall_height / 2]] * _WALL_PIECES
    positions, orientations = [], []
    for i in range(_WALL_PIECES):
        angle = 2.0 * math.pi * i / _WALL_PIECES
        pose = Pose.from_xyz_rpy((0, 0, 0), (0.0, lean, angle))
        positions.append([middle * math.cos(angle), middle * math.sin(angle), 0.0])
        orientations.append(pose.as_quaternion_xyzw().tolist())
    floor_radius = BOWL_BASE_RADIUS - BOWL_WALL / 2
    shape: int = pybullet.createCollisionShapeArray(
        shapeTypes=[pybullet.GEOM_BOX] * _WALL_PIECES + [pybullet.GEOM_CYLINDER],
        halfExtents=[*half_extents, [0.0, 0.0, 0.0]],
        radii=[0.0] * _WALL_PIECES + [floor_radius],
        lengths=[0.0] * _WALL_PIECES + [BOWL_FLOOR],
        collisionFramePositions=[*positions, [0.0, 0.0, -BOWL_HEIGHT / 2 + BOWL_FLOOR / 2]],
        collisionFrameOrientations=[*orientations, [0.0, 0.0, 0.0, 1.0]],
        physicsClientId=client,
    )
    return shape


def _create_body(client: int, shape: int, mass: float, pose: Pose) -> int:
    body: int = pybullet.createMultiBody(
        baseMass=mass,
        baseCollisionShapeIndex=shape,
        basePosition=pose.translation.tolist(),
        baseOrientation=pose.as_quaternion_xyzw().tolist(),
        physicsClientId=client,
    )
    pybullet.changeDynamics(
        body,
        -1,
        lateralFriction=_FRICTION,
        spinningFriction=0.002,
        rollingFriction=1e-4,
        physicsClientId=client,
    )
    return body


def body_pose(client: int, body: int) -> Pose:
    """Where a body's frame is in the base frame."""
    position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
    return Pose.from_quaternion_xyzw(np.asarray(quaternion), np.asarray(position))
