"""Free places for large or crowded things: their outline, not a disc around it, must be free."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception import PlanarPose, Pose
from sim_bridge.errors import LayoutError
from sim_bridge.objects import Shape
from sim_bridge.task_mechanics.free_space import BORDER, distance_to_things

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

_ROUNDS = 8
_DRAWS = 400  # places and yaws that are looked at in each round
_PITCH = 0.02  # of the points that stand for a thing's outline [m]


def free_outline_pose(
    world: SimWorld, shape: Shape, rng: np.random.Generator, room: float, tilt: Pose | None = None
) -> PlanarPose:
    """A random place and yaw at which the shape's outline lies in the workspace, `room` [m] from everything.

    tilt: how the shape is turned before it gets its yaw; upright by default.

    Raises:
        LayoutError: when a bounded number of draws found none.
    """
    spec = world.config.workspace
    low, high = np.array((spec.x_min, spec.y_min)), np.array((spec.x_max, spec.y_max))
    corners = shape.footprint if tilt is None else _outline(tilt.apply(shape.mesh.vertices)[:, :2])
    points = _points(corners)
    distance = distance_to_things(world, world.objects)
    for _ in range(_ROUNDS):
        at = rng.uniform(low, high, size=(_DRAWS, 2))
        yaw = rng.uniform(-math.pi, math.pi, size=_DRAWS)
        turn = np.stack([np.cos(yaw), -np.sin(yaw), np.sin(yaw), np.cos(yaw)], axis=-1).reshape(-1, 2, 2)
        places = points @ turn.transpose(0, 2, 1) + at[:, None]
        free = ((places > low + BORDER) & (places < high - BORDER)).all(axis=(1, 2))
        pixels = ((places[free] - low) / spec.pixel_size).astype(np.intp)
        free[free] = (distance[pixels[..., 1], pixels[..., 0]] > room).all(axis=1)
        if free.any():
            first = int(np.argmax(free))
            return PlanarPose(float(at[first, 0]), float(at[first, 1]), float(yaw[first]))
    size = 1000 * np.ptp(corners, axis=0)
    raise LayoutError(
        f"no room for another {shape.name} ({size[0]:.0f} mm x {size[1]:.0f} mm) beside {len(world.objects)} things"
        f" on {spec.x_max - spec.x_min:.2f} m x {spec.y_max - spec.y_min:.2f} m; use a larger workspace"
    )


def _outline(points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(N, 2) corners of the convex outline of points (M, 2)."""
    return np.asarray(cv2.convexHull(points.astype(np.float32)), dtype=np.float64).reshape(-1, 2)


def _points(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """(N, 2) the corners of a convex outline, and points on its edges and within, closer than `_PITCH` [m]."""
    rings = []
    middle = corners.mean(axis=0)
    size = float(np.linalg.norm(corners - middle, axis=1).max())
    for share in np.linspace(0.0, 1.0, math.ceil(size / _PITCH) + 1):
        ring = middle + (corners - middle) * share
        following = np.roll(ring, -1, axis=0)
        count = max(1, math.ceil(float(np.linalg.norm(following - ring, axis=1).max()) / _PITCH))
        rings += [ring + (following - ring) * step for step in np.arange(count) / count]
    return np.concatenate(rings)
