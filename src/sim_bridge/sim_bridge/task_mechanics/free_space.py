"""Free places on the table for the next thing, one seeded draw each (task specification, section 6.5)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception import PlanarPose, WorkspaceSpec
from sim_bridge.errors import LayoutError
from sim_bridge.objects import SceneObject, Shape

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

FINGER_ROOM = 0.03  # beside a thing that the hand takes: an opened finger [m]
GAP = 0.012  # between things that the hand does not take [m]
BORDER = 0.012  # from a thing to the workspace's edge [m]


def free_pose(
    world: SimWorld,
    shape: Shape,
    rng: np.random.Generator,
    graspable: bool = True,
    radius: float | None = None,
) -> PlanarPose:
    """A place for a thing, drawn uniformly from all that are free, and any yaw.

    graspable: whether the hand will take it, so that fingers need room around it. radius: of the disc that it
    needs [m]; by default that around its footprint.

    Raises:
        LayoutError: when there is none.
    """
    workspace = world.config.workspace
    reach = shape.radius if radius is None else radius
    everything = distance_to_things(world, world.objects)
    taken = distance_to_things(world, [o for o in world.objects if is_graspable(o)])
    free = everything >= reach + (FINGER_ROOM if graspable else GAP)
    free &= taken >= reach + FINGER_ROOM
    free &= _border_distance(workspace) >= reach + BORDER
    cells = np.flatnonzero(free)
    if len(cells) == 0:
        raise LayoutError(
            f"no room for another {shape.name} ({2000 * reach:.0f} mm across) beside {len(world.objects)} things on "
            f"{workspace.x_max - workspace.x_min:.2f} m x {workspace.y_max - workspace.y_min:.2f} m; "
            "use a larger workspace"
        )
    row, col = divmod(int(cells[rng.integers(len(cells))]), workspace.cols)
    x, y = workspace.pixel_to_xy(row, col)
    return PlanarPose(x, y, float(rng.uniform(-math.pi, math.pi)))


def is_graspable(thing: SceneObject) -> bool:
    """Whether the hand is to take it: it moves and has places to hold it by."""
    return not thing.fixed and bool(thing.shape.pinches)


def distance_to_things(world: SimWorld, things: Sequence[SceneObject]) -> npt.NDArray[np.float32]:
    """(rows, cols) from each pixel to the nearest thing's footprint [m]."""
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


def _border_distance(workspace: WorkspaceSpec) -> npt.NDArray[np.float64]:
    """(rows, cols) from each pixel to the workspace's nearest edge [m]."""
    rows, cols = np.arange(workspace.rows), np.arange(workspace.cols)
    from_rows = np.minimum(rows, workspace.rows - 1 - rows) + 0.5
    from_cols = np.minimum(cols, workspace.cols - 1 - cols) + 0.5
    return np.minimum(from_rows[:, None], from_cols[None]) * workspace.pixel_size


def outline(world: SimWorld, thing: SceneObject) -> npt.NDArray[np.float64]:
    """(N, 2) convex outline of a thing as it lies, seen from above [m, base frame]."""
    corners = world.object_pose(thing).apply(thing.mesh.vertices)[:, :2]
    return np.asarray(cv2.convexHull(corners.astype(np.float32)), dtype=np.float64).reshape(-1, 2)
