"""Drops everyday objects on the table, as they may lie about (task specification, sections 5 and 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cliport_perception import Pose
from sim_bridge.errors import LayoutError
from sim_bridge.everyday import EverydayObject
from sim_bridge.objects import Collision, SceneObject, Shape
from sim_bridge.tasks.outline_space import free_outline_pose
from sim_bridge.tasks.pinching import pinches_lying

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

_SECONDS = 1.0  # for objects to come to rest
_LIFT = 0.005  # the lowest point starts this high [m]
_ROOM = 0.03  # beside an object: an opened finger [m]
_SMALLER = 0.85  # of its size, when it cannot be held as it lies
_SHRINKS = 5
_ASIDE = 2.0  # objects fall one by one beside the scene, the first so far along x [m]
_APART = 0.5  # [m]


def drop(
    world: SimWorld, things: Sequence[tuple[EverydayObject, float]], rng: np.random.Generator
) -> list[SceneObject]:
    """Objects, each sized for a cell with that longest edge [m], as they come to rest when they fall in a random
    attitude, at free places with room for the hand.

    One that cannot be held as it lies is made smaller; one without room is left out.
    """
    shapes = [thing.sized(edge) for thing, edge in things]
    attitudes = _resting(world, shapes, rng)
    dropped = []
    for (thing, edge), attitude in zip(things, attitudes, strict=True):
        shape = _holdable(thing, edge, attitude)
        if shape is None:
            continue
        try:
            at = free_outline_pose(world, shape, rng, _ROOM, tilt=attitude)
        except LayoutError:
            continue
        height = -float(attitude.apply(shape.mesh.vertices)[:, 2].min())
        dropped.append(world.add(shape, at.as_pose(height) @ attitude))
    return dropped


def _resting(world: SimWorld, shapes: Sequence[Shape], rng: np.random.Generator) -> list[Pose]:
    """How shapes lie after a fall: their rotations. They fall as convex bodies, which come to rest as they do."""
    fallen = []
    for i, shape in enumerate(shapes):
        assert shape.collision is not None
        body = replace(shape, collision=Collision.hull(np.concatenate([part.corners for part in shape.collision.parts])))
        attitude = Pose.from_quaternion_xyzw(rng.normal(size=4), (0.0, 0.0, 0.0))
        height = _LIFT - float(attitude.apply(shape.mesh.vertices)[:, 2].min())
        fallen.append(world.add(body, Pose(attitude.rotation, np.array([_ASIDE + _APART * i, 0.0, height]))))
    for _ in range(round(_SECONDS * world.config.rate_hz)):
        world.step()
    rotations = [Pose(world.object_pose(thing).rotation, np.zeros(3)) for thing in fallen]
    for thing in fallen:
        world.remove(thing)
    return rotations


def _holdable(thing: EverydayObject, edge: float, attitude: Pose) -> Shape | None:
    """The object as large as it may be and still be held in that attitude."""
    share = 1.0
    for _ in range(_SHRINKS):
        shape = thing.sized(edge, share)
        if pinches_lying(shape, attitude.rotation):
            return shape
        share *= _SMALLER
    return None
