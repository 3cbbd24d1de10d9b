"""Free places for the next thing, on the table and in a container (docs/benchmark.md, "Free places").

All are found on maps of the ground that say how far the nearest thing is; each place is one seeded draw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core import PlanarPose, Pose, WorkspaceSpec
from sim_bridge.errors import LayoutError
from sim_bridge.objects import SceneObject, Shape
from sim_bridge.robot import HAND
from sim_bridge.world import SimWorld

FloatArray = npt.NDArray[np.float64]

# Beside a thing that the hand takes: an opened finger, with a margin [m].
FINGER_CLEARANCE = HAND.mount_thickness + 0.004
GAP = 0.012  # between things that the hand does not take [m]
BORDER = 0.012  # from a thing to the workspace's edge [m]

_MAX_ROUNDS = 8
_DRAWS_PER_ROUND = 400  # places and yaws drawn in each round
_OUTLINE_PITCH = 0.02  # between the points of a thing's outline [m]

_CELL = 0.004  # edge of a cell in the map of a container's floor [m]
# Clearances that are tried in a container [m], the preferred ones first; the first lets the fingers open.
_CONTAINER_GAPS = (HAND.mount_thickness, 0.016, 0.006)
_TURNS = tuple(math.radians(angle) for angle in (0, 30, -30, 60, -60, 90))  # of a thing in a container
_DISTANCE_PER_RADIAN = 0.02  # a turn by one rad costs as much as this distance from the middle [m]


def free_pose(
    world: SimWorld,
    shape: Shape,
    rng: np.random.Generator,
    graspable: bool = True,
    radius: float | None = None,
) -> PlanarPose:
    """Draw a pose for a thing uniformly from all free places, with any yaw.

    graspable: whether the hand will take it, so that the fingers open beside it. radius: of the disc that it
    needs [m]; by default that around its footprint.

    Raises:
        LayoutError: when there is none.
    """
    workspace = world.config.workspace
    reach = shape.radius if radius is None else radius
    everything = distance_to_things(world, world.objects)
    taken = distance_to_things(world, [o for o in world.objects if is_graspable(o)])
    free = everything >= reach + (FINGER_CLEARANCE if graspable else GAP)
    free &= taken >= reach + FINGER_CLEARANCE
    free &= border_distance(workspace) >= reach + BORDER
    cells = np.flatnonzero(free)
    if len(cells) == 0:
        raise LayoutError(
            f"no free place for another {shape.name} ({2000 * reach:.0f} mm across) beside {len(world.objects)} things "
            f"on {workspace.x_max - workspace.x_min:.2f} m x {workspace.y_max - workspace.y_min:.2f} m; "
            "use a larger workspace"
        )
    row, col = divmod(int(cells[rng.integers(len(cells))]), workspace.cols)
    x, y = workspace.pixel_to_xy(row, col)
    return PlanarPose(x, y, float(rng.uniform(-math.pi, math.pi)))


def free_outline_pose(
    world: SimWorld, shape: Shape, rng: np.random.Generator, clearance: float, tilt: Pose | None = None
) -> PlanarPose:
    """Draw a place and yaw at which the shape's outline lies in the workspace, `clearance` [m] from everything.

    tilt: how the shape is turned before it gets its yaw; upright by default.

    Raises:
        LayoutError: when a bounded number of draws found none.
    """
    spec = world.config.workspace
    low, high = np.array((spec.x_min, spec.y_min)), np.array((spec.x_max, spec.y_max))
    corners = shape.footprint if tilt is None else _hull(tilt.apply(shape.mesh.vertices)[:, :2])
    points = _points_within(corners)
    distance = distance_to_things(world, world.objects)
    for _ in range(_MAX_ROUNDS):
        at = rng.uniform(low, high, size=(_DRAWS_PER_ROUND, 2))
        yaw = rng.uniform(-math.pi, math.pi, size=_DRAWS_PER_ROUND)
        turn = np.stack([np.cos(yaw), -np.sin(yaw), np.sin(yaw), np.cos(yaw)], axis=-1).reshape(-1, 2, 2)
        places = points @ turn.transpose(0, 2, 1) + at[:, None]
        free = np.asarray(spec.contains(places, BORDER).all(axis=1))
        pixels = spec.to_pixels(places[free])
        free[free] = (distance[pixels[..., 0], pixels[..., 1]] > clearance).all(axis=1)
        if free.any():
            first = int(np.argmax(free))
            return PlanarPose(float(at[first, 0]), float(at[first, 1]), float(yaw[first]))
    size = 1000 * np.ptp(corners, axis=0)
    raise LayoutError(
        f"no free place for another {shape.name} ({size[0]:.0f} mm x {size[1]:.0f} mm) beside {len(world.objects)} "
        f"things on {spec.x_max - spec.x_min:.2f} m x {spec.y_max - spec.y_min:.2f} m; use a larger workspace"
    )


def place_in_container(world: SimWorld, container: Pose, size: tuple[float, float], thing: SceneObject) -> PlanarPose:
    """Return the place nearest to the container's middle where a thing, lying as it does now or a little turned,
    touches neither walls nor other things; the one with the largest clearance where there is no such place.

    size (x, y) of the container [m]. The place is where the thing's planar pose is to be.
    """
    clearance = _clearance_in(container, size, world, thing)
    rows, cols = np.indices(clearance.shape)
    x, y = (cols - 0.5) * _CELL - size[0] / 2, (rows - 0.5) * _CELL - size[1] / 2
    corners = _box(world, thing)
    yaw = PlanarPose.from_pose(container).yaw
    clear = np.stack([_least(clearance, _turned(corners, turn - yaw)) for turn in _TURNS])
    cost = np.hypot(x, y) + _DISTANCE_PER_RADIAN * np.abs(_TURNS)[:, None, None]
    best = int(np.argmax(clear))
    for gap in _CONTAINER_GAPS:
        if (clear >= gap).any():
            best = int(np.argmin(np.where(clear >= gap, cost, np.inf)))
            break
    turn, at = divmod(best, clearance.size)
    place = container.apply((float(x.flat[at]), float(y.flat[at]), 0.0))
    return PlanarPose(float(place[0]), float(place[1]), world.planar_pose(thing).yaw + _TURNS[turn])


def is_graspable(thing: SceneObject) -> bool:
    """Return True if the hand is to take the thing: it moves and has pinches."""
    return not thing.fixed and bool(thing.shape.pinches)


def distance_to_things(world: SimWorld, things: Sequence[SceneObject]) -> npt.NDArray[np.float32]:
    """Return (rows, cols) distance from each pixel to the nearest thing's footprint [m]."""
    workspace = world.config.workspace
    free = np.full(workspace.shape, 255, dtype=np.uint8)
    for thing in things:
        corners = outline(world, thing)
        pixels = (corners - (workspace.x_min, workspace.y_min)) / workspace.pixel_size - 0.5
        cv2.fillConvexPoly(free, np.rint(pixels * 16).astype(np.int32), 0, shift=4)
    if (free == 255).all():
        return np.full(workspace.shape, np.inf, dtype=np.float32)
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distance, dtype=np.float32) * np.float32(workspace.pixel_size)


def outline(world: SimWorld, thing: SceneObject) -> FloatArray:
    """Return the convex outline of a thing as it lies, seen from above, (N, 2) [m, base frame]."""
    return _hull(world.object_pose(thing).apply(thing.mesh.vertices)[:, :2])


def border_distance(workspace: WorkspaceSpec) -> FloatArray:
    """Return (rows, cols) distance from each pixel to the workspace's nearest edge [m]."""
    rows, cols = np.arange(workspace.rows), np.arange(workspace.cols)
    from_rows = np.minimum(rows, workspace.rows - 1 - rows) + 0.5
    from_cols = np.minimum(cols, workspace.cols - 1 - cols) + 0.5
    return np.minimum(from_rows[:, None], from_cols[None]) * workspace.pixel_size


def _hull(points: FloatArray) -> FloatArray:
    """Return the corners of the convex outline of points (M, 2), (N, 2)."""
    return np.asarray(cv2.convexHull(points.astype(np.float32)), dtype=np.float64).reshape(-1, 2)


def _points_within(corners: FloatArray) -> FloatArray:
    """Return the corners of a convex outline with points on its edges and within, `_OUTLINE_PITCH` apart, (N, 2)."""
    rings = []
    middle = corners.mean(axis=0)
    size = float(np.linalg.norm(corners - middle, axis=1).max())
    for share in np.linspace(0.0, 1.0, math.ceil(size / _OUTLINE_PITCH) + 1):
        ring = middle + (corners - middle) * share
        following = np.roll(ring, -1, axis=0)
        count = max(1, math.ceil(float(np.linalg.norm(following - ring, axis=1).max()) / _OUTLINE_PITCH))
        rings += [ring + (following - ring) * step for step in np.arange(count) / count]
    return np.concatenate(rings)


def _clearance_in(container: Pose, size: tuple[float, float], world: SimWorld, thing: SceneObject) -> FloatArray:
    """Return (rows, cols) distance from each cell of the container's floor to the nearest wall or other thing [m]."""
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


def _least(clearance: FloatArray, points: FloatArray) -> FloatArray:
    """Return (rows, cols) the least clearance at any of the points (N, 2) [m] about each cell."""
    rows, cols = np.indices(clearance.shape)
    least = clearance.copy()
    for dx, dy in np.rint(points / _CELL).astype(np.intp):
        at = np.clip(rows + dy, 0, clearance.shape[0] - 1), np.clip(cols + dx, 0, clearance.shape[1] - 1)
        least = np.minimum(least, clearance[at])
    return least


def _box(world: SimWorld, thing: SceneObject) -> FloatArray:
    """Return points (N, 2) on the outline, seen from above, of the box around a
    thing by which it is scored, about its origin [m]."""
    low, high = thing.mesh.vertices.min(axis=0), thing.mesh.vertices.max(axis=0)
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    flat = (corners @ world.object_pose(thing).rotation.T)[:, :2]
    ring = cv2.convexHull(flat.astype(np.float32)).reshape(-1, 2).astype(np.float64)
    return np.concatenate([ring + (np.roll(ring, -1, axis=0) - ring) * share for share in (0.0, 0.33, 0.67)])


def _turned(points: FloatArray, angle: float) -> FloatArray:
    c, s = math.cos(angle), math.sin(angle)
    return points @ np.array([[c, s], [-s, c]])
