"""Target of a box on the picture: the cloud in it, cropped to the finger height, and its centroid.

See docs/paper.md, "Real robot".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core.action import Primitive
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.demonstration import PixelBox
from demo_tool.errors import BoxError
from demo_tool.live_view import LiveView
from demo_tool.station_config import BoxConfig
from panda_model import HandModel

FloatArray = npt.NDArray[np.float64]

_NOISE_SHARE = 0.01  # of the points, which may be noise above the top
_MAX_DRAWN_PIXELS = 400  # of the cloud
_MIN_SWEEP_LENGTH = 1e-6  # a shorter way has no direction [m]


@dataclass(frozen=True, eq=False)
class BoxTarget:
    """Centroid and extent of the cloud in a box.

    centroid: (3,) [m, base frame]; pixels: (N, 2) (row, col) of the cloud's points; top: height of the highest point
    [m]; width: extent along the closing direction [m].
    """

    centroid: FloatArray
    pixels: npt.NDArray[np.int64]
    top: float
    width: float

    def pose(self, yaw: float) -> PlanarPose:
        """Return the hand's pose over the centroid, at `yaw` [rad]."""
        return PlanarPose(float(self.centroid[0]), float(self.centroid[1]), yaw)

    def shown_pixels(self) -> list[list[int]]:
        """Return some of the pixels, evenly chosen, to be drawn."""
        step = math.ceil(len(self.pixels) / _MAX_DRAWN_PIXELS)
        return [[int(row), int(col)] for row, col in self.pixels[::step]]


def find_target(
    view: LiveView,
    box: PixelBox,
    yaw: float,
    workspace: WorkspaceSpec,
    config: BoxConfig,
    what: str,
    needs_object: bool,
) -> BoxTarget:
    """Find the centroid of the cloud in a box of the picture.

    Each ground cell of the workspace's pixel size counts once, so that the side which faces a tilted camera does not
    pull the centroid, as in the executor's grasp. yaw: of the closing direction [rad]; what: "pick" or "place", for
    messages; needs_object: True where something must stand above the table.

    Raises:
        BoxError: when there is too little depth, no object, or the centroid is outside the workspace.
    """
    points, pixels = _points_in(view, box, config, what)
    heights = points[:, 2]
    top = top_of(heights)
    lowest = top - config.finger_height
    if needs_object:
        _require_object(top, config, what)
        lowest = max(lowest, config.table_z + config.min_height / 2.0)
    chosen = (heights >= lowest) & (heights <= top + config.finger_height)
    points, pixels = points[chosen], pixels[chosen]
    centroid = _cell_mean(points, workspace.pixel_size)
    if not workspace.contains_xy(float(centroid[0]), float(centroid[1])):
        raise BoxError(
            f"the {what} ({centroid[0]:.3f}, {centroid[1]:.3f}) m is outside the workspace, which spans "
            f"x {workspace.x_min:g}..{workspace.x_max:g}, y {workspace.y_min:g}..{workspace.y_max:g} m"
        )
    along = points[:, :2] @ np.array([math.cos(yaw), math.sin(yaw)])
    return BoxTarget(centroid, pixels, top, float(np.ptp(along)))


def top_of(heights: FloatArray) -> float:
    """Return the height of the top without the few points that may be noise above it [m]."""
    above = max(3, round(_NOISE_SHARE * len(heights)))
    return float(np.partition(heights, -above)[-above])


def _require_object(top: float, config: BoxConfig, what: str) -> None:
    """Raise BoxError when the top [m] is hardly above the table."""
    if top < config.table_z + config.min_height:
        raise BoxError(
            f"nothing stands in the {what} box: its highest point is {_mm(top - config.table_z)} mm above the table "
            f"(at least {_mm(config.min_height)} mm needed); draw the box around an object"
        )


def _points_in(view: LiveView, box: PixelBox, config: BoxConfig, what: str) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Return the points (N, 3) [m, base frame] of a box, and their pixels (N, 2)."""
    window = slice(box.top, box.bottom), slice(box.left, box.right)
    depth = view.depth_m[window]
    seen = np.isfinite(depth)
    count = int(seen.sum())
    needed = max(config.min_points, math.ceil(config.min_share * seen.size))
    if count < needed:
        raise BoxError(
            f"the camera knows the depth of {count} of the {seen.size} pixels in the {what} box (at least {needed} "
            "needed); draw it larger, or where the surface does not shine"
        )
    rays = view.camera.rays()[window][seen].astype(np.float64)
    points = view.camera_in_base.apply(rays * depth[seen, None])
    return points, np.argwhere(seen) + np.array([box.top, box.left])


def _cell_mean(points: FloatArray, cell: float) -> FloatArray:
    """Return the mean (3,) of points (N, 3), each ground cell counted once."""
    _, inverse, counts = np.unique(
        np.floor(points[:, :2] / cell).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    weights = 1.0 / counts[inverse.reshape(-1)]
    mean: FloatArray = np.average(points, axis=0, weights=weights)
    return mean


def sweep_yaw(start: PlanarPose, end: PlanarPose) -> float | None:
    """Return the yaw of jaws across the way from start to end [rad, 0 to pi]; None where there is no way."""
    x, y = end.x - start.x, end.y - start.y
    if math.hypot(x, y) <= _MIN_SWEEP_LENGTH:
        return None
    return (math.atan2(y, x) + math.pi / 2.0) % math.pi


def finger_outlines(
    view: LiveView, pose: PlanarPose, z: float, hand: HandModel, primitive: Primitive = Primitive.PICK_PLACE
) -> list[list[list[float]]]:
    """Return both fingers at height z [m], open as on their way down: polygons of (row, col) on the picture."""
    along = np.array([math.cos(pose.yaw), math.sin(pose.yaw), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    centre = np.array([pose.x, pose.y, z])
    outlines, inner = [], _opening(hand, primitive) / 2.0
    for side in (-1.0, 1.0):
        near, far = side * inner, side * (inner + hand.finger_thickness)
        corners = [
            centre + a * along + b * hand.finger_half_width * across
            for a, b in ((near, -1.0), (near, 1.0), (far, 1.0), (far, -1.0))
        ]
        outlines.append(to_pixels(view, np.array(corners)))
    return outlines


def _opening(hand: HandModel, primitive: Primitive) -> float:
    """Return the opening with which the fingers go down for a primitive [m]."""
    openings = {Primitive.PICK_PLACE: hand.opening, Primitive.SWEEP: 0.0, Primitive.FOLD: hand.fold_opening}
    return openings[primitive]


def closing_directions(view: LiveView, x: float, y: float, z: float, n_rotations: int) -> list[list[float]]:
    """Return the closing direction of each rotation on the picture: (row, col) of length 1."""
    yaws = np.arange(n_rotations) * 2.0 * np.pi / n_rotations
    reach = 0.02
    ends = np.column_stack([x + reach * np.cos(yaws), y + reach * np.sin(yaws), np.full(n_rotations, z)])
    pixels = np.array(to_pixels(view, np.vstack([[[x, y, z]], ends])))
    steps = pixels[1:] - pixels[0]
    lengths = np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9)
    return [[round(float(v), 4) for v in step] for step in steps / lengths]


def to_pixels(view: LiveView, points: FloatArray) -> list[list[float]]:
    """Return the pixels (row, col) of points (N, 3) [m, base frame]."""
    pixels = np.nan_to_num(view.camera.project(view.camera_in_base.inverse().apply(points)))
    return [[round(float(row), 1), round(float(col), 1)] for row, col in pixels]


def table_point(view: LiveView, box: PixelBox, table_z: float) -> FloatArray:
    """Return the point (3,) of the table in the middle of a box [m, base frame]; the camera's own if it looks up."""
    point = table_at(view, (box.top + box.bottom) // 2, (box.left + box.right) // 2, table_z)
    return view.camera_in_base.translation if point is None else point


def table_at(view: LiveView, row: int, col: int, table_z: float) -> FloatArray | None:
    """Return the point (3,) of the table at a pixel [m, base frame]; None where the camera looks past it."""
    ray = view.camera_in_base.rotation @ view.camera.rays()[row, col].astype(np.float64)
    origin = view.camera_in_base.translation
    reach = (table_z - origin[2]) / ray[2] if abs(ray[2]) > 1e-9 else 0.0
    point: FloatArray = origin + reach * ray
    return point if reach > 0.0 else None


def box_around(view: LiveView, pose: PlanarPose, edge: float, table_z: float) -> PixelBox | None:
    """Return the box that shows the square of `edge` [m] around a pose; None when it is not in the picture."""
    half = edge / 2.0
    corners = [[pose.x + a * half, pose.y + b * half, table_z] for a in (-1, 1) for b in (-1, 1)]
    pixels = np.array(to_pixels(view, np.array(corners)))
    size = np.array([view.camera.height, view.camera.width])
    low = np.clip(np.floor(pixels.min(axis=0)), 0, size).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)), 0, size).astype(int)
    if not np.all(high > low):
        return None
    return PixelBox(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def _mm(metres: float) -> int:
    return round(metres * 1000.0)
