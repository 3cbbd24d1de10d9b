"""What a box on the picture means: the cloud in it, cropped to the finger height, and its centroid (paper, D)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_episodes.demonstration import PixelBox
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Primitive
from cliport_perception.workspace import WorkspaceSpec
from demo_tool.errors import BoxError
from demo_tool.live_view import LiveView
from demo_tool.station_config import BoxConfig

FloatArray = npt.NDArray[np.float64]

_TOP_SHARE = 0.01  # of the points, which may be noise above the top
_SHOWN = 400  # pixels of the cloud that are drawn at most
# The hand, as panda_executor has it in hand_geometry.py and config.py [m].
_OPENINGS = {Primitive.PICK_PLACE: 0.08, Primitive.SWEEP: 0.0, Primitive.FOLD: 0.03}
_FINGER_HALF_WIDTH = 0.0105
_FINGER_THICKNESS = 0.0152
_SAME_PLACE = 1e-6  # a shorter way has no direction [m]


@dataclass(frozen=True, eq=False)
class BoxTarget:
    """centroid: (3,) [m, base frame]; pixels: (N, 2) (row, col) of the points behind it; top: of what is in the
    box [m]; width: of it along the closing direction [m]."""

    centroid: FloatArray
    pixels: npt.NDArray[np.int64]
    top: float
    width: float

    def pose(self, yaw: float) -> PlanarPose:
        """Where the hand goes, at `yaw` [rad]."""
        return PlanarPose(float(self.centroid[0]), float(self.centroid[1]), yaw)

    def shown_pixels(self) -> list[list[int]]:
        """Some of the pixels, evenly chosen, to draw."""
        step = math.ceil(len(self.pixels) / _SHOWN)
        return [[int(row), int(col)] for row, col in self.pixels[:: max(step, 1)]]


def find_target(
    view: LiveView, box: PixelBox, yaw: float, workspace: WorkspaceSpec, config: BoxConfig, what: str, stands: bool
) -> BoxTarget:
    """The centroid of the cloud in a box of the picture.

    Each ground cell of the workspace's pixel size counts once, so that the side which faces a tilted camera does not
    pull the centroid, as in the executor's grasp.

    Args:
        yaw: of the closing direction [rad]; what: "pick" or "place", for messages;
        stands: whether something must stand above the table there.

    Raises:
        BoxError: when there is too little depth, nothing stands there, or it is outside the workspace.
    """
    points, pixels = _points_in(view, box, config, what)
    heights = points[:, 2]
    above = min(max(3, round(_TOP_SHARE * len(heights))), len(heights))
    top = float(np.partition(heights, -above)[-above])
    if stands and top < config.table_z + config.min_height:
        raise BoxError(
            f"nothing stands in the {what} box: its highest point is {_mm(top - config.table_z)} mm above the table "
            f"(at least {_mm(config.min_height)} mm needed); draw the box around an object"
        )
    lowest = top - config.finger_height
    if stands:
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


def _points_in(view: LiveView, box: PixelBox, config: BoxConfig, what: str) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Points (N, 3) [m, base frame] of a box, and their pixels (N, 2)."""
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
    """Mean (3,) of points (N, 3), each ground cell counted once."""
    _, inverse, counts = np.unique(
        np.floor(points[:, :2] / cell).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    weights = 1.0 / counts[inverse.reshape(-1)]
    mean: FloatArray = np.average(points, axis=0, weights=weights)
    return mean


def across(start: PlanarPose, end: PlanarPose) -> float | None:
    """The yaw of jaws in a line across the way from start to end [rad, 0 to pi]; None where there is no way."""
    x, y = end.x - start.x, end.y - start.y
    return (math.atan2(y, x) + math.pi / 2.0) % math.pi if math.hypot(x, y) > _SAME_PLACE else None


def finger_outlines(
    view: LiveView, pose: PlanarPose, z: float, primitive: Primitive = Primitive.PICK_PLACE
) -> list[list[list[float]]]:
    """The fingers, as far open as they go down, at height z [m] as polygons of (row, col) on the picture."""
    along = np.array([math.cos(pose.yaw), math.sin(pose.yaw), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    centre = np.array([pose.x, pose.y, z])
    outlines, inner = [], _OPENINGS[primitive] / 2.0
    for side in (-1.0, 1.0):
        near, far = side * inner, side * (inner + _FINGER_THICKNESS)
        corners = [
            centre + a * along + b * _FINGER_HALF_WIDTH * across
            for a, b in ((near, -1.0), (near, 1.0), (far, 1.0), (far, -1.0))
        ]
        outlines.append(to_pixels(view, np.array(corners)))
    return outlines


def closing_directions(view: LiveView, x: float, y: float, z: float, n_rotations: int) -> list[list[float]]:
    """For each rotation the direction (row, col), of length 1, in which the fingers close as the picture shows it."""
    yaws = np.arange(n_rotations) * 2.0 * np.pi / n_rotations
    reach = 0.02
    ends = np.column_stack([x + reach * np.cos(yaws), y + reach * np.sin(yaws), np.full(n_rotations, z)])
    pixels = np.array(to_pixels(view, np.vstack([[[x, y, z]], ends])))
    steps = pixels[1:] - pixels[0]
    lengths = np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9)
    return [[round(float(v), 4) for v in step] for step in steps / lengths]


def to_pixels(view: LiveView, points: FloatArray) -> list[list[float]]:
    """Where points (N, 3) [m, base frame] are on the picture: (row, col)."""
    pixels = np.nan_to_num(view.camera.project(view.camera_in_base.inverse().apply(points)))
    return [[round(float(row), 1), round(float(col), 1)] for row, col in pixels]


def table_point(view: LiveView, box: PixelBox, table_z: float) -> FloatArray:
    """(3,) where the middle of a box meets the table [m, base frame]; far below a camera that looks up: its foot."""
    row, col = (box.top + box.bottom) // 2, (box.left + box.right) // 2
    ray = view.camera_in_base.rotation @ view.camera.rays()[row, col].astype(np.float64)
    origin = view.camera_in_base.translation
    reach = (table_z - origin[2]) / ray[2] if abs(ray[2]) > 1e-9 else 0.0
    point: FloatArray = origin + max(reach, 0.0) * ray
    return point


def box_around(view: LiveView, pose: PlanarPose, edge: float, table_z: float) -> PixelBox | None:
    """The picture's part that shows the square of `edge` [m] around a pose; None when it is not in the picture."""
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
