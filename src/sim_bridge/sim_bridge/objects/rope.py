"""The rope: a chain of beads; and the square with one side missing that it completes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from cliport_core import Pose
from sim_bridge.bullet import pybullet
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision
from sim_bridge.objects.shape import SceneObject, Shape

ROPE_BEADS = 20
SQUARE_SIDE = 2 * 0.005 * ROPE_BEADS * math.sqrt(2)  # also the rope's length [m]
BEAD_SPACING = SQUARE_SIDE / ROPE_BEADS  # between the middles of neighbours [m]
BEAD_SIZE = 0.01  # edge of the cube that a bead collides as [m]
BEAD_MASS = 0.1  # [kg]
BEAD_FRICTION = 0.5
SQUARE_HEIGHT = 0.001  # [m]

_BEAD_RADIUS = 0.0075  # of the ball that is seen [m]
_LINK_FORCE = 100.0  # that holds two neighbours together at most [N]
_STRIP = 0.01  # width of the square's sides [m]
_DROP_HEIGHT = 0.05  # the lowest bead falls from one spacing above it [m]
_WOBBLE = 0.0005  # of each bead before the rope falls, per axis: standard deviation [m]


@lru_cache(maxsize=1)
def bead_shape() -> Shape:
    """Return one bead: seen as a ball, in physics a cube, so that it does not roll (docs/benchmark.md, "Objects")."""
    steps = 8
    profile = [
        (_BEAD_RADIUS * math.sin(math.pi * i / steps), -_BEAD_RADIUS * math.cos(math.pi * i / steps))
        for i in range(steps + 1)
    ]
    ball = TriangleMesh.revolved(profile, segments=16)
    return Shape("bead", ball, Collision.box((BEAD_SIZE,) * 3), BEAD_MASS, symmetry=0.0, friction=BEAD_FRICTION)


@lru_cache(maxsize=1)
def square_shape() -> Shape:
    """Return three flat strips along the sides -y, -x and +x; its frame in its middle, on the table."""
    half = SQUARE_SIDE / 2
    strips = [
        ((SQUARE_SIDE + _STRIP, _STRIP, SQUARE_HEIGHT), (0.0, -half)),
        ((_STRIP, SQUARE_SIDE, SQUARE_HEIGHT), (-half, 0.0)),
        ((_STRIP, SQUARE_SIDE, SQUARE_HEIGHT), (half, 0.0)),
    ]
    mesh = TriangleMesh.joined(
        [
            TriangleMesh.box(size).transformed(Pose.from_xyz_rpy((x, y, SQUARE_HEIGHT / 2), (0.0, 0.0, 0.0)))
            for size, (x, y) in strips
        ]
    )
    return Shape("square", mesh, None, 0.0, symmetry=math.tau)


def link_beads(client: int, beads: Sequence[SceneObject]) -> None:
    """Tie each bead's z axis to the next bead's middle, so that the middles of neighbours stay BEAD_SPACING apart.

    client: the PyBullet server that the beads are in.
    """
    for parent, child in pairwise(beads):
        link = pybullet.createConstraint(
            parent.body,
            -1,
            child.body,
            -1,
            jointType=pybullet.JOINT_POINT2POINT,
            jointAxis=[0, 0, 0],
            parentFramePosition=[0, 0, BEAD_SPACING],
            childFramePosition=[0, 0, 0],
            physicsClientId=client,
        )
        pybullet.changeConstraint(link, maxForce=_LINK_FORCE, physicsClientId=client)


def standing_chain(rng: np.random.Generator) -> list[Pose]:
    """Return a rope that stands upright above the origin, its first bead lowest, and falls into a heap.

    Yaw and wobble are random: physics repeats itself, and one stack would fall into the same heap in every scene.
    """
    yaw = rng.uniform(-math.pi, math.pi)
    wobble = rng.normal(0.0, _WOBBLE, (ROPE_BEADS, 2))
    return [
        Pose.from_xyz_rpy((x, y, _DROP_HEIGHT + (i + 1) * BEAD_SPACING), (0.0, 0.0, yaw))
        for i, (x, y) in enumerate(wobble)
    ]
