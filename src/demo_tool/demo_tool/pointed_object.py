"""The thing that a person points at on the picture: the box around it, and how the fingers would close on it."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox
from demo_tool.box_target import box_around, table_at, top_of
from demo_tool.errors import BoxError
from demo_tool.live_view import LiveView
from demo_tool.station_config import BoxConfig

_WINDOW = 200  # pixels to each side of the point that are looked at
_DEPTH_STEP = 0.008  # between neighbouring pixels of one surface, at most [m]
_SLACK = 4  # pixels that a click may miss a thing by
_BORDER = 2  # pixels of the box around the thing
_SPOT = 0.05  # edge of the box around a point of the table [m]


class PointedThing(NamedTuple):
    """Box around a thing, and the yaw at which the fingers close across its narrow side [rad, 0 to pi]."""

    box: PixelBox
    yaw: float


def thing_at(view: LiveView, row: int, col: int, config: BoxConfig) -> PointedThing | None:
    """Return the thing that stands at a pixel, or None where nothing stands.

    It is what rises above the table around the pixel without a step in depth.
    """
    top, left = max(row - _WINDOW, 0), max(col - _WINDOW, 0)
    window = slice(top, row + _WINDOW + 1), slice(left, col + _WINDOW + 1)
    depth = view.depth_m[window]
    rays = view.camera.rays()[window].astype(np.float64)
    points = view.camera_in_base.apply((rays * depth[..., None]).reshape(-1, 3)).reshape(rays.shape)
    with np.errstate(invalid="ignore"):
        raised = points[..., 2] > config.table_z + config.min_height
    seed = _nearest(raised, row - top, col - left)
    if seed is None:
        return None
    chosen = _surface(np.where(raised, depth, 0.0).astype(np.float32), seed)
    if int(chosen.sum()) < config.min_points:
        return None
    rows, cols = np.nonzero(chosen)
    low, high = np.array([rows.min(), cols.min()]) - _BORDER, np.array([rows.max(), cols.max()]) + _BORDER + 1
    size = np.array([view.camera.height, view.camera.width])
    corners = np.clip(np.array([low, high]) + np.array([top, left]), 0, size)
    box = PixelBox(*(int(v) for v in corners.reshape(-1)))
    return PointedThing(box, _narrow_yaw(points[chosen], config.finger_height))


def spot_at(view: LiveView, row: int, col: int, table_z: float) -> PixelBox:
    """Return a box around the table's point at a pixel. Raises BoxError where the table is not seen there."""
    point = table_at(view, row, col, table_z)
    pose = None if point is None else PlanarPose(float(point[0]), float(point[1]), 0.0)
    box = None if pose is None else box_around(view, pose, _SPOT, table_z)
    if box is None:
        raise BoxError("the table is not to be seen there: point at a place on it, or draw a box")
    return box


def _nearest(raised: npt.NDArray[np.bool_], row: int, col: int) -> tuple[int, int] | None:
    """Return the raised pixel nearest to (row, col), None where none is so near that it can be meant."""
    first = np.maximum([row - _SLACK, col - _SLACK], 0)
    found = np.argwhere(raised[first[0] : row + _SLACK + 1, first[1] : col + _SLACK + 1]) + first
    if not len(found):
        return None
    nearest = found[np.argmin(np.abs(found - [row, col]).max(axis=1))]
    return int(nearest[0]), int(nearest[1])


def _surface(depth: npt.NDArray[np.float32], seed: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return the pixels that are joined to the seed (row, col) without a step; a depth of 0 joins nothing."""
    mask = np.zeros((depth.shape[0] + 2, depth.shape[1] + 2), dtype=np.uint8)
    flags = 8 | cv2.FLOODFILL_MASK_ONLY | (1 << 8)
    cv2.floodFill(depth, mask, (seed[1], seed[0]), 0, _DEPTH_STEP, _DEPTH_STEP, flags)
    return mask[1:-1, 1:-1].astype(bool)


def _narrow_yaw(points: npt.NDArray[np.float64], finger_height: float) -> float:
    """Return the direction of the narrow side of the upper part of points (N, 3), seen from above [rad, 0 to pi]."""
    upper = points[points[:, 2] > top_of(points[:, 2]) - finger_height]
    _, (width, height), degrees = cv2.minAreaRect((1000.0 * upper[:, :2]).astype(np.float32))
    return float(np.deg2rad(degrees if width <= height else degrees + 90.0) % np.pi)
