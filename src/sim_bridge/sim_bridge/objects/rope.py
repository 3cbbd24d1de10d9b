"""The rope: a chain of beads; and the square with one side missing that it completes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cliport_perception import Pose
from sim_bridge.bullet import pybullet
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects.collision import Collision
from sim_bridge.objects.shape import SceneObject, Shape

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

ROPE_BEADS = 20
SQUARE_SIDE = 2 * 0.005 * ROPE_BEADS * math.sqrt(2)  # also the rope's length [m]
BEAD_SPACING = SQUARE_SIDE / ROPE_BEADS  # between the middles of neighbours [m]
BEAD_SIZE = 0.01  # edge of the cube that a bead collides as [m]
BEAD_MASS = 0.02  # [kg]
BEAD_FRICTION = 0.5
SQUARE_HEIGHT = 0.001  # [m]

_BEAD_RADIUS = 0.0075  # of the ball that is seen [m]
_LINK_FORCE = 100.0  # that holds two neighbours together at most [N]
_STRIP = 0.01  # width of the square's sides [m]
_RISE, _LEVEL = 0.5, math.sqrt(0.75)  # of a link before the rope falls: up and along
_BEND, _WOBBLE = 0.2, 0.4  # how a link turns against the one before: always, and at random [rad]
_DROP = 0.02  # height from which the lowest bead falls [m]


@lru_cache(maxsize=1)
def bead_shape() -> Shape:
    """One bead: seen as a ball, in physics a cube, so that it does not roll (task specification, section 3)."""
    steps = 8
    profile = [
        (_BEAD_RADIUS * math.sin(math.pi * i / steps), -_BEAD_RADIUS * math.cos(math.pi * i / steps))
        for i in range(steps + 1)
    ]
    ball = TriangleMesh.revolved(profile, segments=16)
    return Shape("bead", ball, Collision.box((BEAD_SIZE,) * 3), BEAD_MASS, symmetry=0.0, friction=BEAD_FRICTION)


@lru_cache(maxsize=1)
def square_shape() -> Shape:
    """Three flat strips along the sides -y, -x and +x; its frame in its middle, on the table."""
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


def link_beads(world: SimWorld, beads: Sequence[SceneObject]) -> None:
    """Tie each bead's z axis to the next bead's middle: the middles of neighbours stay BEAD_SPACING apart."""
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
            physicsClientId=world.client,
        )
        pybullet.changeConstraint(link, maxForce=_LINK_FORCE, physicsClientId=world.client)


def leaning_chain(rng: np.random.Generator) -> list[Pose]:
    """A rope that leans and winds at random, just above the table, about the origin: it falls into a loose curve."""
    headings = rng.uniform(-math.pi, math.pi) + np.cumsum(
        rng.choice([-1.0, 1.0]) * _BEND + rng.normal(0.0, _WOBBLE, ROPE_BEADS)
    )
    steps = [np.array([math.cos(h) * _LEVEL, math.sin(h) * _LEVEL, _RISE]) * BEAD_SPACING for h in headings]
    middles = np.cumsum([np.zeros(3), *steps[:-1]], axis=0)
    middles[:, :2] -= middles[:, :2].mean(axis=0)
    middles[:, 2] += _DROP
    tilt = math.acos(_RISE)
    return [Pose.from_xyz_rpy(m, (0.0, tilt, h)) for m, h in zip(middles, headings, strict=True)]
