"""Where in a container the next thing has room, and how it is turned there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception import PlanarPose, Pose
from sim_bridge.objects import SceneObject
from sim_bridge.task_mechanics.free_space import outline

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

FloatArray = npt.NDArray[np.float64]

_CELL = 0.004  # of the map of the container's floor [m]
_GAPS = (0.026, 0.016, 0.006)  # to its walls and to what lies in it [m]; the first leaves room for opened fingers
_TURNS = tuple(math.radians(angle) for angle in (0, 30, -30, 60, -60, 90))  # of the thing, the preferred ones first
_TURN_COST = 0.02  # distance from the middle that a turn by one rad is worth [m]


def room_in(world: SimWorld, container: Pose, size: tuple[float, float], thing: SceneObject) -> PlanarPose:
    """The place nearest to the container's middle where a thing, lying as it does now or a little turned, touches
    neither walls nor other things; that with the most room where there is none.

    size (x, y) of the container [m]. The place is where the thing's planar pose is to be.
    """
    room = _room(world, container, size, thing)
    rows, cols = np.indices(room.shape)
    x, y = (cols - 0.5) * _CELL - size[0] / 2, (rows - 0.5) * _CELL - size[1] / 2
    corners = _box(world, thing)
    yaw = PlanarPose.from_pose(container).yaw
    clear = np.stack([_least(room, _turned(corners, turn - yaw)) for turn in _TURNS])
    cost = np.hypot(x, y) + _TURN_COST * np.abs(_TURNS)[:, None, None]
    best = int(np.argmax(clear))
    for gap in _GAPS:
        if (clear >= gap).any():
            best = int(np.argmin(np.where(clear >= gap, cost, np.inf)))
            break
    turn, at = divmod(best, room.size)
    place = container.apply((float(x.flat[at]), float(y.flat[at]), 0.0))
    return PlanarPose(float(place[0]), float(place[1]), world.planar_pose(thing).yaw + _TURNS[turn])


def _room(world: SimWorld, container: Pose, size: tuple[float, float], thing: SceneObject) -> FloatArray:
    """(rows, cols) from each cell of the container's floor to the nearest wall or other thing [m]; walls around it."""
    free = np.zeros((int(size[1] / _CELL) + 2, int(size[0] / _CELL) + 2), dtype=np.uint8)
    free[1:-1, 1:-1] = 255
    for other in world.objects:
        if other is not thing and not other.fixed:
            seen = outline(world, other)
            local = container.inverse().apply(np.column_stack([seen, np.zeros(len(seen))]))[:, :2]
            pixels = (local + np.array(size) / 2) / _CELL + 0.5
            cv2.fillConvexPoly(free, np.rint(pixels * 16).astype(np.int32), 0, shift=4)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distance, dtype=np.float64) * _CELL


def _least(room: FloatArray, points: FloatArray) -> FloatArray:
    """(rows, cols) the least room at any of the points (N, 2) [m] about each cell."""
    rows, cols = np.indices(room.shape)
    least = room.copy()
    for dx, dy in np.rint(points / _CELL).astype(np.intp):
        at = np.clip(rows + dy, 0, room.shape[0] - 1), np.clip(cols + dx, 0, room.shape[1] - 1)
        least = np.minimum(least, room[at])
    return least


def _box(world: SimWorld, thing: SceneObject) -> FloatArray:
    """(N, 2) points on the outline, seen from above, of the box around a thing by which it is scored, about its
    origin [m]."""
    low, high = thing.mesh.vertices.min(axis=0), thing.mesh.vertices.max(axis=0)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    flat = (corners @ world.object_pose(thing).rotation.T)[:, :2]
    ring = cv2.convexHull(flat.astype(np.float32)).reshape(-1, 2).astype(np.float64)
    return np.concatenate([ring + (np.roll(ring, -1, axis=0) - ring) * share for share in (0.0, 0.33, 0.67)])


def _turned(points: FloatArray, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]])
