"""Drops everyday objects on the table, as they may lie about (docs/benchmark.md, "Everyday objects")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from cliport_core import PlanarPose, Pose
from sim_bridge.errors import LayoutError
from sim_bridge.everyday import EverydayObject
from sim_bridge.objects import Collision, Pinch, SceneObject, Shape
from sim_bridge.task_mechanics.clearance import palm_is_free
from sim_bridge.task_mechanics.pinches import FARTHEST, OUTERMOST, gripper_at, pinches_lying
from sim_bridge.task_mechanics.placing import FINGER_CLEARANCE, free_outline_pose
from sim_bridge.world import SimWorld

_SECONDS = 1.0  # for objects to come to rest
_LIFT = 0.005  # the lowest point starts this high [m]
_PLACES = 8  # that are tried for one thing
_SHARES = (1.0, 0.85, 0.72, 0.61)  # of an object's size: the largest at which it can be held as it lies
_ASIDE = (1.0, -0.8)  # objects fall beside the scene, out of each other's way: where the first one does [m]
_APART = 0.4  # [m]
_IN_A_ROW = 5


@dataclass(frozen=True, eq=False)
class _Lying:
    """A thing in the scene, its place, and how it can be held relative to that."""

    thing: SceneObject
    attitude: Pose
    at: PlanarPose
    pinches: list[Pinch]

    def has_room(self, world: SimWorld) -> bool:
        """Whether the palm fits above it in one of its pinches."""
        return any(palm_is_free(world, self.thing, gripper_at(self.at, pinch)) for pinch in self.pinches)


def drop(
    world: SimWorld, things: Sequence[tuple[EverydayObject, float]], rng: np.random.Generator
) -> list[SceneObject]:
    """Objects, each sized for a cell with that longest edge [m], as they come to rest when they fall in a random
    attitude, at free places with room for the hand.

    One that cannot be held as it lies is made smaller; one without room is left out.
    """
    attitudes = _resting(world, [thing.sized(edge) for thing, edge in things], rng)
    lying = []
    for (thing, edge), attitude in zip(things, attitudes, strict=True):
        held = _holdable(thing, edge, attitude)
        if held is None:
            continue
        shape, pinches = held
        try:
            at = free_outline_pose(world, shape, rng, FINGER_CLEARANCE, tilt=attitude)
        except LayoutError:
            continue
        lying.append(_Lying(world.add(shape, _pose(shape, at, attitude)), attitude, at, pinches))
    return [one.thing for one in lying if _made_reachable(world, one, rng)]


def _made_reachable(world: SimWorld, lying: _Lying, rng: np.random.Generator) -> bool:
    """Move a thing to where the palm has room; when there is no such place, take it away."""
    for _ in range(_PLACES):
        if lying.has_room(world):
            return True
        shape = lying.thing.shape
        try:
            lying = replace(lying, at=free_outline_pose(world, shape, rng, FINGER_CLEARANCE, tilt=lying.attitude))
        except LayoutError:
            break
        world.move_object(lying.thing, _pose(shape, lying.at, lying.attitude))
    world.remove(lying.thing)
    return False


def _pose(shape: Shape, at: PlanarPose, attitude: Pose) -> Pose:
    """Where a shape's frame is when it lies there in that attitude."""
    return at.as_pose(-_lowest(shape, attitude)) @ attitude


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


def _holdable(thing: EverydayObject, edge: float, attitude: Pose) -> tuple[Shape, list[Pinch]] | None:
    """The object as large as it may be and still be held in that attitude, and how; if nowhere near its middle,
    then elsewhere."""
    for farthest in (FARTHEST, OUTERMOST):
        for share in _SHARES:
            shape = thing.sized(edge, share)
            pinches = pinches_lying(shape, attitude.rotation, farthest)
            if pinches:
                return shape, pinches
    return None
