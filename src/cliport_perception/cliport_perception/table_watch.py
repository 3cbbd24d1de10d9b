"""A watch over the table's plane: a camera that was bumped sees the table elsewhere than before."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cliport_core.pose import FloatArray, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_model import CameraModel
from cliport_perception.depth_noise import DepthNoise, DepthNoiseMeter, depth_sigma

# A usable calibration has the table from so far below the workspace's floor to so far above it, or above z = 0 [m].
_BELOW_FLOOR, _ABOVE_FLOOR, _ABOVE_ZERO = 0.04, 0.06, 0.04
_SEARCHED_BELOW = 0.3  # how far below that floor a table is still looked for [m]
_BIN = 0.005  # of heights, from which the first guess of the plane comes [m]
_LEAST_POINTS = 50
_REMEDY = "take away what covers it, or put the camera back, or calibrate again and restart perception"


class TablePlane(NamedTuple):
    """The plane z = height + slope_x (x - x0) + slope_y (y - y0) about the workspace's middle (x0, y0) [m, base frame].

    residual: median distance of the table's points from it [m].
    """

    height: float
    slope_x: float
    slope_y: float
    residual: float

    def shift_from(self, other: TablePlane) -> tuple[float, float]:
        """Return how far this plane is from another: of the middle [m], and of the tilt [rad]."""
        tilt = math.hypot(self.slope_x - other.slope_x, self.slope_y - other.slope_y)
        return abs(self.height - other.height), math.atan(tilt)


@dataclass(frozen=True)
class TableLimits:
    """Limits within which the table must stay.

    max_shift [m] and max_tilt [rad]: against the first frames, for a camera with little noise; see `grown`.
    max_off_tilt [rad]: of those against the base's x-y plane. first_frames: whose median is the reference. patience:
    frames in a row beyond a limit before one is refused. min_share: of the pixels that look at the workspace, on the
    plane.
    """

    max_shift: float = 0.003
    max_tilt: float = math.radians(0.2)
    max_off_tilt: float = math.radians(1.5)
    first_frames: int = 5
    patience: int = 3
    min_share: float = 0.25

    def grown(self, noise: DepthNoise) -> TableLimits:
        """Return the limits for a camera with this noise: its plane wanders more."""
        return replace(self, max_shift=self.max_shift * noise.growth, max_tilt=self.max_tilt * noise.growth)


class _SeenPoints(NamedTuple):
    """Points (N, 3) [m, base frame], and by how much each one's ray falls for each metre of depth (N,)."""

    points: FloatArray
    drops: FloatArray


class TableWatch:
    """Follows the table through the frames of one camera at one pose."""

    def __init__(
        self,
        camera: CameraModel,
        camera_in_base: Pose,
        workspace: WorkspaceSpec,
        limits: TableLimits | None = None,
        every: int = 6,
    ) -> None:
        """Begin without a reference. every: pixel of a row and of a column that is looked at."""
        self._limits = limits or TableLimits()
        self._every = every
        self._workspace = workspace
        rays = camera.rays()[::every, ::every].reshape(-1, 3).astype(np.float64)
        self._rays = rays @ camera_in_base.rotation.T
        self._origin = camera_in_base.translation
        self._middle = np.array([workspace.x_min + workspace.x_max, workspace.y_min + workspace.y_max]) / 2.0
        self._least = self._least_points()
        self._first: list[TablePlane] = []
        self._beyond = 0
        self.plane: TablePlane | None = None
        self._meter = DepthNoiseMeter()

    @property
    def noise(self) -> DepthNoise:
        """The noise of depth on the table over the last frames that were checked."""
        return self._meter.noise

    def check(self, depth_m: npt.NDArray[np.float32]) -> str | None:
        """Note a depth image (H, W) [m]; return why it must not be acted on, or None."""
        seen = self._seen_over_workspace(depth_m)
        plane = self._plane_of(seen.points)
        if plane is None and len(seen.points) < self._least:
            return None  # hidden by a hand or by things: nothing can be said
        if plane is not None:
            off = seen.points[:, 2] - plane.height
            off -= (seen.points[:, :2] - self._middle) @ np.array([plane.slope_x, plane.slope_y])
            self._meter.add(depth_sigma(off, seen.drops))
        words = self._judge(plane)
        self._beyond = self._beyond + 1 if words else 0
        return words if self._beyond >= self._limits.patience else None

    def measure(self, depth_m: npt.NDArray[np.float32]) -> TablePlane | None:
        """Return the table's plane in a depth image (H, W) [m], or None when too little of it is seen.

        It is sought where the calibration has it, and when it is not there, from 0.3 m below the workspace to its top.
        """
        return self._plane_of(self._seen_over_workspace(depth_m).points)

    def _judge(self, plane: TablePlane | None) -> str | None:
        """Return what is wrong with a plane; the first good ones become the reference."""
        if plane is None:
            return f"no table is seen where the calibration has it: {_REMEDY}"
        self.plane = plane
        if not self._is_expected(plane.height):
            return f"the table lies {1e3 * plane.height:+.0f} mm from z = 0: {_REMEDY}"
        if len(self._first) < self._limits.first_frames:
            self._first.append(plane)
            return None
        return self._fault(plane)

    def _seen_over_workspace(self, depth_m: npt.NDArray[np.float32]) -> _SeenPoints:
        """Return the points over the workspace's area at which a table is looked for."""
        depth = depth_m[:: self._every, :: self._every].reshape(-1, 1)
        with np.errstate(invalid="ignore"):
            points = self._rays * depth + self._origin
            inside = self._workspace.contains(points)
            inside &= points[:, 2] > self._workspace.z_min - _SEARCHED_BELOW
            inside &= points[:, 2] < self._workspace.z_max
        return _SeenPoints(points[inside], -self._rays[inside, 2])

    def _plane_of(self, points: npt.NDArray[np.float64]) -> TablePlane | None:
        near = points[self._is_expected(points[:, 2])]
        return self._fit(near) or self._fit(points)

    def _is_expected(self, height: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return a mask of the heights [m] at which a usable calibration may have the table."""
        z, floor = np.asarray(height), self._workspace.z_min
        return np.asarray((z > floor - _BELOW_FLOOR) & (z < max(floor + _ABOVE_FLOOR, _ABOVE_ZERO)), dtype=np.bool_)

    def _least_points(self) -> float:
        """Return how many points make a table: a share of the pixels whose rays meet the area just above its floor."""
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (self._workspace.z_min + 0.02 - self._origin[2]) / self._rays[:, 2]
            points = self._rays * reach[:, None] + self._origin
        looked = int(np.count_nonzero(self._workspace.contains(points) & (reach > 0.0)))
        return max(_LEAST_POINTS, self._limits.min_share * looked)

    def _fit(self, points: npt.NDArray[np.float64]) -> TablePlane | None:
        """Fit a plane to what most points (N, 3) share: things upon the table count less and less."""
        if len(points) < self._least:
            return None
        rows = np.column_stack([np.ones(len(points)), points[:, :2] - self._middle])
        z = points[:, 2]
        lowest = float(z.min())
        counts = np.bincount(((z - lowest) / _BIN).astype(np.intp))
        level = lowest + (int(np.argmax(counts)) + 0.5) * _BIN
        plane = np.array([level, 0.0, 0.0])
        for reach in (0.025, 0.015, 0.01, 0.007, 0.005, 0.005):
            off = z - rows @ plane
            near = np.abs(off) < reach
            if np.count_nonzero(near) < self._least:
                return None
            plane = np.linalg.lstsq(rows[near], z[near], rcond=None)[0]
        residual = float(np.median(np.abs(z[near] - rows[near] @ plane)))
        return TablePlane(float(plane[0]), float(plane[1]), float(plane[2]), residual)

    def _fault(self, plane: TablePlane) -> str | None:
        limits = self._limits.grown(self.noise)
        reference = TablePlane(*np.median(np.array(self._first), axis=0))
        shift, tilt = plane.shift_from(reference)
        if shift > limits.max_shift or tilt > limits.max_tilt:
            return (
                f"the camera was moved: the table lies {1e3 * shift:.0f} mm and {math.degrees(tilt):.1f} degrees off "
                "where it lay at first; put it back, or calibrate again and restart perception"
            )
        tilt = math.atan(math.hypot(reference.slope_x, reference.slope_y))
        if tilt > limits.max_off_tilt:
            return f"this calibration tilts the table by {math.degrees(tilt):.1f} degrees: calibrate the camera again"
        return None
