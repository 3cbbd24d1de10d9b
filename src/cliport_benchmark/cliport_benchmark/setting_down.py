"""Lowers a thing onto whatever lies beneath it."""

from __future__ import annotations

import numpy as np

from cliport_core import Pose
from sim_bridge.bullet import pybullet
from sim_bridge.objects import SceneObject
from sim_bridge.task_mechanics.placing import outline
from sim_bridge.world import SimWorld

_ABOVE_ALL = 0.35  # height that nothing on the table reaches [m]
_STEP = 0.001  # by which a thing is lowered beside a near one [m]


def set_down(world: SimWorld, thing: SceneObject, pose: Pose) -> None:
    """Put a thing, turned and over the place as in `pose`, as low as it comes from above: at most 1 mm is left.

    The pose's own height does not matter.
    """
    bottom = float((pose.rotation @ thing.mesh.vertices.T)[2].min())
    height = _ABOVE_ALL - bottom
    _lift(world, thing, pose, height)
    beneath = [other.body for other in world.objects if other is not thing and _may_touch(world, thing, other)]
    while (free := min(_distance(world, thing, beneath), height + bottom)) >= 0.0:
        height -= max(free, _STEP)  # a thing comes no nearer than it is lowered
        _lift(world, thing, pose, height)
    _lift(world, thing, pose, height + _STEP)


def _lift(world: SimWorld, thing: SceneObject, pose: Pose, height: float) -> None:
    world.move_object(thing, Pose(pose.rotation, np.array([*pose.translation[:2], height])))


def _may_touch(world: SimWorld, thing: SceneObject, other: SceneObject) -> bool:
    """Return True if the rectangles around both, seen from above, overlap."""
    if other.shape.collision is None:
        return False
    mine, its = outline(world, thing), outline(world, other)
    return bool((mine.min(axis=0) < its.max(axis=0)).all() and (its.min(axis=0) < mine.max(axis=0)).all())


def _distance(world: SimWorld, thing: SceneObject, bodies: list[int]) -> float:
    """Return the distance to the nearest of the bodies [m], negative when they overlap."""
    contacts = [
        contact
        for body in bodies
        for contact in pybullet.getClosestPoints(thing.body, body, _ABOVE_ALL, physicsClientId=world.client)
    ]
    return min((contact[8] for contact in contacts), default=_ABOVE_ALL)
