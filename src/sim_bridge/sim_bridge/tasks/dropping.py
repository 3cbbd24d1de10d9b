"""Drops everyday objects on the table, as they may lie about (task specification, sections 5 and 14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from cliport_perception import Pose
from sim_bridge.errors import LayoutError
from sim_bridge.everyday import EverydayObject
from sim_bridge.objects import Collision, SceneObject, Shape
from sim_bridge.tasks.outline_space import free_outline_pose
from sim_bridge.tasks.pinch_search import FARTHEST
from sim_bridge.tasks.pinching import OUTERMOST, pinches_lying

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

_SECONDS = 1.0  # for objects to come to rest
_LIFT = 0.005  # the lowest point starts this high [m]
_ROOM = 0.03  # beside an object: an opened finger [m]
_SHARES = (1.0, 0.85, 0.72, 0.61)  # of an object's size: the largest at which it can be held as it lies
_ASIDE = (1.0, -0.8)  # objects fall beside the scene, out of each other's way: where the first one does [m]
_APART = 0.4  # [m]
_IN_A_ROW = 5


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
        dropped.append(world.add(shape, at.as_pose(-_lowest(shape, attitude)) @ attitude))
    return dropped


def _resting(world: SimWorld, shapes: Sequence[Shape], rng: np.random.Generator) -> list[Pose]:
    """How shapes lie after a fall: their rotations. They fall as convex bodies, which come to rest as they do."""
    fallen = []
    for i, shape in enumerate(shapes):
        attitude = Pose.from_quaternion_xyzw(rng.normal(size=4), (0.0, 0.0, 0.0))
        x, y = _ASIDE[0] + _APART * (i // _IN_A_ROW), _ASIDE[1] + _APART * (i % _IN_A_ROW)
        at = np.array([x, y, _LIFT - _lowest(shape, attitude)])
        fallen.append(world.add(replace(shape, collision=Collision.hull(_corners(shape))), Pose(attitude.rotation, at)))
    for _ in range(round(_SECONDS * world.config.rate_hz)):
        world.step()
    rotations = [Pose(world.object_pose(thing).rotation, np.zeros(3)) for thing in fallen]
    for thing in fallen:
        world.remove(thing)
    return rotations


def _corners(shape: Shape) -> npt.NDArray[np.float64]:
    """(N, 3) of everything that collides [m, body frame]."""
    assert shape.collision is not None
    return np.concatenate([part.corners for part in shape.collision.parts])


def _lowest(shape: Shape, attitude: Pose) -> float:
    """How far below its origin it reaches when it is turned so, negative [m]."""
    return float(attitude.apply(_corners(shape))[:, 2].min())


def _holdable(thing: EverydayObject, edge: float, attitude: Pose) -> Shape | None:
    """The object as large as it may be and still be held in that attitude; if nowhere near its middle, elsewhere."""
    for farthest in (FARTHEST, OUTERMOST):
        for share in _SHARES:
            shape = thing.sized(edge, share)
            if pinches_lying(shape, attitude.rotation, farthest):
                return shape
    return None
