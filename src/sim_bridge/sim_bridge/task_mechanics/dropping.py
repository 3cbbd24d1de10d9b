"""Drops everyday objects on the table, in random attitudes (docs/benchmark.md, "Everyday objects")."""

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

_FALL_TIME = 1.0  # simulated time for objects to come to rest [s]
_START_HEIGHT = 0.005  # of an object's lowest point before its fall [m]
_MAX_PLACES = 8  # places that are tried for one object
_SIZE_SHARES = (1.0, 0.85, 0.72, 0.61)  # shares of an object's size that are tried, the largest first
_FIRST_FALL_XY = (1.0, -0.8)  # objects fall beside the scene: place of the first one [m]
_FALL_SPACING = 0.4  # between objects that fall [m]
_FALLS_PER_ROW = 5


@dataclass(frozen=True, eq=False)
class _DroppedObject:
    """A thing in the scene, its place, and how it can be held relative to that."""

    thing: SceneObject
    attitude: Pose
    at: PlanarPose
    pinches: list[Pinch]

    def is_reachable(self, world: SimWorld) -> bool:
        """Return True if the palm fits above it in one of its pinches."""
        return any(palm_is_free(world, self.thing, gripper_at(self.at, pinch)) for pinch in self.pinches)


def drop(
    world: SimWorld, things: Sequence[tuple[EverydayObject, float]], rng: np.random.Generator
) -> list[SceneObject]:
    """Drop objects, each with its cell's longest edge [m], in random attitudes and return them as they came to rest, at
    free places with clearance for the hand.

    One that cannot be held as it lies is made smaller; one without a free place is left out.
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
        lying.append(_DroppedObject(world.add(shape, _pose(shape, at, attitude)), attitude, at, pinches))
    return [one.thing for one in lying if _made_reachable(world, one, rng)]


def _made_reachable(world: SimWorld, lying: _DroppedObject, rng: np.random.Generator) -> bool:
    """Move a thing to a place with clearance for the palm and return True;
    where there is none, remove it and return False."""
    for _ in range(_MAX_PLACES):
        if lying.is_reachable(world):
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
    """Return the pose of a shape's frame that lies at a place in an attitude."""
    return at.as_pose(-_lowest(shape, attitude)) @ attitude


def _resting(world: SimWorld, shapes: Sequence[Shape], rng: np.random.Generator) -> list[Pose]:
    """Return the rotations in which shapes come to rest after a fall, in which they collide as their convex hulls."""
    fallen = []
    for i, shape in enumerate(shapes):
        attitude = Pose.from_quaternion_xyzw(rng.normal(size=4), (0.0, 0.0, 0.0))
        x = _FIRST_FALL_XY[0] + _FALL_SPACING * (i // _FALLS_PER_ROW)
        y = _FIRST_FALL_XY[1] + _FALL_SPACING * (i % _FALLS_PER_ROW)
        at = np.array([x, y, _START_HEIGHT - _lowest(shape, attitude)])
        fallen.append(world.add(replace(shape, collision=Collision.hull(_corners(shape))), Pose(attitude.rotation, at)))
    for _ in range(round(_FALL_TIME * world.config.rate_hz)):
        world.step()
    rotations = [Pose(world.object_pose(thing).rotation, np.zeros(3)) for thing in fallen]
    for thing in fallen:
        world.remove(thing)
    return rotations


def _corners(shape: Shape) -> npt.NDArray[np.float64]:
    """Return the corners of everything that collides, (N, 3) [m, body frame]."""
    assert shape.collision is not None
    return np.concatenate([part.corners for part in shape.collision.parts])


def _lowest(shape: Shape, attitude: Pose) -> float:
    """Return the height of the lowest corner of a turned shape above its origin, negative [m]."""
    return float(attitude.apply(_corners(shape))[:, 2].min())


def _holdable(thing: EverydayObject, edge: float, attitude: Pose) -> tuple[Shape, list[Pinch]] | None:
    """Return the largest size of an object at which it can be held in that attitude, and
    its pinches: near its middle if possible, else elsewhere."""
    for farthest in (FARTHEST, OUTERMOST):
        for share in _SIZE_SHARES:
            shape = thing.sized(edge, share)
            pinches = pinches_lying(shape, attitude.rotation, farthest)
            if pinches:
                return shape, pinches
    return None
