"""The view of the workspace from a camera: in which part of its image, and between which depths of each pixel."""

from __future__ import annotations

from itertools import product
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec

FloatImage: TypeAlias = npt.NDArray[np.float32]


def bounds(mask: npt.NDArray[np.bool_], margin: int = 0) -> tuple[slice, slice]:
    """Return the rows and columns that hold all of a mask (H, W), and `margin` more around them where there are any."""
    if not mask.any():
        return slice(0, 0), slice(0, 0)
    found = []
    for axis, size in ((1, mask.shape[0]), (0, mask.shape[1])):
        at = np.flatnonzero(mask.any(axis=axis))
        found.append(slice(max(0, int(at[0]) - margin), min(size, int(at[-1]) + 1 + margin)))
    return found[0], found[1]


def region_of_interest(
    rays: npt.NDArray[np.float32], camera_in_base: Pose, workspace: WorkspaceSpec
) -> tuple[slice, slice]:
    """Return the image rows and columns whose rays (H, W, 3) meet the workspace's volume."""
    enter, leave = _depths_inside(np.moveaxis(rays, -1, 0), camera_in_base, workspace, 0.0)
    return bounds((leave >= np.fmax(enter, 0.0)) & np.isfinite(leave), margin=1)


def depths_of_samples(
    rays: npt.NDArray[np.float32], camera_in_base: Pose, workspace: WorkspaceSpec
) -> tuple[FloatImage, FloatImage]:
    """Return the least and largest depth (h, w) [m] of samples inside the workspace, at pixels with rays (3, h, w).

    A sample lies on a pixel's ray or between it and its neighbours': by as much the volume is taken to be larger.
    """
    w = workspace
    corners = np.array(list(product((w.x_min, w.x_max), (w.y_min, w.y_max), (w.z_min, w.z_max))))
    reach = max(0.0, float(camera_in_base.inverse().apply(corners)[:, 2].max()))  # depth of the farthest corner
    apart = sum(float(np.fmax.reduce(np.abs(np.diff(rays, axis=axis)), axis=None, initial=0.0)) for axis in (1, 2))
    return _depths_inside(rays, camera_in_base, workspace, 2.0 * reach * apart)  # twice: a step of depth beyond reach


def widest_gaps(rays: npt.NDArray[np.float32], camera_in_base: Pose, workspace: WorkspaceSpec) -> list[float]:
    """Return how far apart neighbouring pixels (down, right) see the workspace's floor at most [m]."""
    drop = workspace.z_min - camera_in_base.translation[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = rays[:2] * (drop / rays[2])  # (2, h, w): where the rays meet the floor
    x, y = xy[0] + camera_in_base.translation[0], xy[1] + camera_in_base.translation[1]
    inside = (x > workspace.x_min) & (x < workspace.x_max) & (y > workspace.y_min) & (y < workspace.y_max)
    widest = []
    for axis in (1, 2):
        gap = np.abs(np.diff(xy, axis=axis)).max(axis=0)
        near = np.take(inside, range(gap.shape[axis - 1]), axis=axis - 1)
        widest.append(float(gap[near].max()) if near.any() else workspace.pixel_size)
    return widest


def _depths_inside(
    rays: npt.NDArray[np.float32], camera_in_base: Pose, workspace: WorkspaceSpec, margin: float
) -> tuple[FloatImage, FloatImage]:
    """Return the depths (h, w) [m] at which rays (3, h, w) enter and leave the workspace's volume (slab test).

    margin: how much larger the volume is on every side [m]. A ray that misses it enters after it leaves.
    """
    low = np.array([workspace.x_min, workspace.y_min, workspace.z_min]) - margin - camera_in_base.translation
    high = np.array([workspace.x_max, workspace.y_max, workspace.z_max]) + margin - camera_in_base.translation
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low = low.astype(np.float32)[:, None, None] / rays
        to_high = high.astype(np.float32)[:, None, None] / rays
    return np.fmin(to_low, to_high).max(axis=0), np.fmax(to_low, to_high).min(axis=0)
