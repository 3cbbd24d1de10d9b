"""A watch over the table's plane: a camera that was bumped sees the table elsewhere than before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.camera_model import CameraModel


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

    max_shift [m] and max_tilt [rad]: against the first frames; max_off_tilt [rad]: of those against the base's
    x-y plane. first_frames: whose median is the reference. patience: frames in a row beyond a limit before one is
    refused. min_share: of the pixels that look at the workspace, on the plane.
    """

    max_shift: float = 0.003
    max_tilt: float = math.radians(0.2)
    max_off_tilt: float = math.radians(1.5)
    first_frames: int = 5
    patience: int = 3
    min_share: float = 0.25


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
        self._first: list[TablePlane] = []
        self._beyond = 0
        self.plane: TablePlane | None = None

    def check(self, depth_m: npt.NDArray[np.float32]) -> str | None:
        """Note a depth image (H, W) [m]; return why it must not be acted on, or None."""
        plane = self.measure(depth_m)
        if plane is None:
            return None  # hidden by a hand or by things: nothing can be said
        self.plane = plane
        if len(self._first) < self._limits.first_frames:
            self._first.append(plane)
            return None
        words = self._fault(plane)
        self._beyond = self._beyond + 1 if words else 0
        return words if self._beyond >= self._limits.patience else None

    def measure(self, depth_m: npt.NDArray[np.float32]) -> TablePlane | None:
        """Return the table's plane in a depth image (H, W) [m], or None when too little of it is seen."""
        depth = depth_m[:: self._every, :: self._every].reshape(-1, 1)
        with np.errstate(invalid="ignore"):
            points = self._rays * depth + self._origin
            inside = self._workspace.contains(points)
            low = self._workspace.z_min
            band = inside & (points[:, 2] > low - 0.04) & (points[:, 2] < low + 0.06)
        looked = self._pixels_on_workspace
        if np.count_nonzero(band) < max(50, self._limits.min_share * looked):
            return None
        return self._fit(points[band], looked)

    @property
    def _pixels_on_workspace(self) -> int:
        """The number of pixels whose rays meet the workspace's area a little above its floor."""
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (self._workspace.z_min + 0.02 - self._origin[2]) / self._rays[:, 2]
            points = self._rays * reach[:, None] + self._origin
        return int(np.count_nonzero(self._workspace.contains(points) & (reach > 0.0)))

    def _fit(self, points: npt.NDArray[np.float64], looked: int) -> TablePlane | None:
        """Fit a plane to what most points share: things upon the table count less and less."""
        rows = np.column_stack([np.ones(len(points)), points[:, :2] - self._middle])
        z = points[:, 2]
        bins, edges = np.histogram(z, bins=20)
        level = edges[int(np.argmax(bins))] + (edges[1] - edges[0]) / 2.0
        plane = np.array([level, 0.0, 0.0])
        for reach in (0.025, 0.015, 0.01, 0.007, 0.005, 0.005):
            off = z - rows @ plane
            near = np.abs(off) < reach
            if np.count_nonzero(near) < max(50, self._limits.min_share * looked):
                return None
            plane = np.linalg.lstsq(rows[near], z[near], rcond=None)[0]
        residual = float(np.median(np.abs(z[near] - rows[near] @ plane)))
        return TablePlane(float(plane[0]), float(plane[1]), float(plane[2]), residual)

    def _fault(self, plane: TablePlane) -> str | None:
        limits = self._limits
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
