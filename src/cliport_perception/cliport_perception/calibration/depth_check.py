"""The depth camera's scale and offset, and the table's height, from one frame under a calibration.

True depth = scale x measured depth + offset. Along each ray that meets the table the calibration says how deep a plane
z = height lies; a board's corners have a true depth that their pixels and the board's size give. The table alone does
not tell scale from height: without a board it is taken to be at z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.pose import FloatArray
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.calibration.result import SIGMAS
from cliport_perception.calibration.view import BoardView
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_model import CameraModel
from cliport_perception.table_watch import TablePlane

_SINGULAR = 1e12  # condition of normal equations that leave something open


@dataclass(frozen=True)
class DepthCheckConfig:
    """Choices of the check.

    every: pixel of a row and of a column that is used. near: table's points lie so near its plane [m], or within
    near_residuals of its residual. blocks: along each side of the picture, whose errors are taken as independent.
    window: pixels around a corner over which depth is a median. board_px: least error of a corner [px]. max_scale: a
    scale whose standard deviation is more is not told apart from an offset. min_points, min_blocks: of a table.
    """

    every: int = 6
    near: float = 0.006
    near_residuals: float = 4.0
    blocks: int = 6
    window: int = 5
    board_px: float = 0.1
    max_scale: float = 0.01
    min_points: int = 50
    min_blocks: int = 4
    min_corners: int = 4


class Estimate(NamedTuple):
    """One number and its standard deviation."""

    value: float
    sigma: float


class DepthCheck(NamedTuple):
    """Findings of one frame on depth and table.

    scale, offset [m]: true depth = scale x measured + offset; scale None: not told apart from an offset, and taken as
    1. table: the height of the table's top at the workspace's middle, as perception sees it now, in the base frame [m].
    mended: the same once depth is corrected, where a board says how deep it is; None: the table was taken to be at
    z = 0. span: of the depths that were used [m].
    """

    scale: Estimate | None
    offset: Estimate
    table: Estimate
    mended: Estimate | None
    span: float

    def in_words(self, base_frame: str) -> list[str]:
        """Return the numbers, a line each; base_frame: the arm's."""
        source = "the table, taken to be at z = 0" if self.mended is None else "table and board"
        offset = f"{1e3 * self.offset.value:+.1f} mm (+-{1e3 * SIGMAS * self.offset.sigma:.1f})"
        if self.scale is None:
            depth = (
                f"depth: true = measured {offset}, from {source}; the depths seen span {1e3 * self.span:.0f} mm, too "
                "little to tell a scale from an offset"
            )
        else:
            scale = f"{self.scale.value:.4f} (+-{SIGMAS * self.scale.sigma:.4f})"
            depth = f"depth: true = {scale} x measured {offset}, from {source}"
        lines = [
            f"{depth}; {SIGMAS:g} standard deviations",
            f"table_z: perception sees the table's top at {self.table.value:.4f} (+-{SIGMAS * self.table.sigma:.4f}) m "
            f"in {base_frame}: set the executor's table_z to {self.table.value:.4f}",
        ]
        if self.mended is not None:
            mended = f"{self.mended.value:.4f} (+-{SIGMAS * self.mended.sigma:.4f})"
            lines.append(f"table: by the board, and with depth corrected so, its top is at {mended} m")
        return lines


class _Rays(NamedTuple):
    """Measurements (N,): depth [m]; reach, the true depth for each metre that the table is below the camera; group."""

    depth: FloatArray
    reach: FloatArray
    points: FloatArray
    group: npt.NDArray[np.intp]


def check_depth(
    depth_m: npt.NDArray[np.float32],
    board: BoardView | None,
    calibration: CameraCalibration,
    workspace: WorkspaceSpec,
    plane: TablePlane,
    config: DepthCheckConfig | None = None,
) -> DepthCheck | None:
    """Return what a depth image (H, W) [m] says, or None when too little of the table is seen.

    board: where it is seen, through the same lens; plane: the table's, as measured in this image.
    """
    config = config or DepthCheckConfig()
    rays = _table_rays(depth_m, calibration, workspace, plane, config)
    if len(rays.depth) < config.min_points or len(np.unique(rays.group)) < config.min_blocks:
        return None
    above = float(calibration.camera_in_base.translation[2])
    corners = None if board is None else _corners(depth_m, board, config)
    if corners is not None and len(corners) < config.min_corners:
        corners = None
    middle = np.array([workspace.x_min + workspace.x_max, workspace.y_min + workspace.y_max]) / 2.0
    rows = np.column_stack([np.ones(len(rays.points)), rays.points[:, :2] - middle])
    flat, flat_covariance = _solve(rows, rays.points[:, 2], rays.group)
    table = Estimate(float(flat[0]), math.sqrt(flat_covariance[0, 0]))
    sigma = 0.0 if board is None else _distance_sigma(board, calibration.intrinsics, config)
    span = float(np.ptp(rays.depth))
    found = _estimates(rays, above, corners, sigma, True)
    if not found[0].sigma <= config.max_scale:
        _, offset, mended = _estimates(rays, above, corners, sigma, False)
        return DepthCheck(None, offset, table, mended, span)
    return DepthCheck(*found[:2], table, found[2], span)


def _estimates(
    rays: _Rays, above: float, corners: FloatArray | None, distance_sigma: float, free_scale: bool
) -> tuple[Estimate, Estimate, Estimate | None]:
    """Return scale, offset [m] and the table's height [m], the last only where a board's corners (C, 2) are known.

    corners: measured and true depth [m]; distance_sigma: of the board's distance, as a share of it.
    """
    near = corners if corners is not None else np.zeros((0, 2))
    found, covariance = _parameters(rays, above, near, free_scale)
    if len(near):
        other, _ = _parameters(rays, above, near * (1.0, 1.0 + distance_sigma), free_scale)
        covariance = covariance + np.outer(other - found, other - found)
    sigmas = np.sqrt(np.diag(covariance).clip(min=0.0))
    scale, offset, height = (Estimate(float(value), float(sigma)) for value, sigma in zip(found, sigmas))
    return scale, offset, height if len(near) else None


def _parameters(rays: _Rays, above: float, corners: FloatArray, free_scale: bool) -> tuple[FloatArray, FloatArray]:
    """Return scale, offset [m] and the table's height [m], and their covariance (3, 3).

    What is measured, with its noise, is the depth: a ray on the table measures p reach (above - height) - q, a corner
    p depth - q, where p is 1 / scale and q is offset / scale. This is linear in p, q and r = p (above - height).
    Without corners the height is 0, with the scale fixed p is 1.
    """
    count = len(corners)
    groups = np.concatenate([rays.group, rays.group.max() + 1 + np.arange(count, dtype=np.intp)])
    values = np.concatenate([rays.depth, corners[:, 0]])
    known = np.concatenate([np.zeros(len(rays.depth)), corners[:, 1]])
    reach = np.concatenate([rays.reach, np.zeros(count)])
    # p, q and r of the unknowns that are left, each a column
    lift = np.eye(3) if count else np.array([[1.0, 0.0], [0.0, 1.0], [above, 0.0]])
    fixed = np.zeros(3)
    if not free_scale:
        fixed, lift = lift[:, 0], lift[:, 1:]
    rows = np.column_stack([known, -np.ones(len(values)), reach])
    found, covariance = _solve(rows @ lift, values - rows @ fixed, groups)
    p, q, r = fixed + lift @ found
    slope = np.array([[-1.0 / p**2, 0.0, 0.0], [-q / p**2, 1.0 / p, 0.0], [r / p**2, 0.0, -1.0 / p]])
    if not np.isfinite(covariance).all():
        return np.array([1.0 / p, q / p, above - r / p]), np.full((3, 3), np.inf)
    full = slope @ lift @ covariance @ lift.T @ slope.T
    return np.array([1.0 / p, q / p, above - r / p]), full


def _solve(rows: FloatArray, values: FloatArray, groups: npt.NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares solution (P,) and its covariance (P, P), a jackknife over the groups of rows (M, P).

    What cannot be told apart has a covariance without bound.
    """
    unit = np.abs(rows).max(axis=0)
    rows = rows / unit
    normal, right = rows.T @ rows, rows.T @ values
    if np.linalg.cond(normal) > _SINGULAR:
        return np.linalg.lstsq(rows, values, rcond=None)[0] / unit, np.full(normal.shape, np.inf)
    found = np.linalg.solve(normal, right)
    names = np.unique(groups)
    total = np.zeros_like(normal)
    for name in names:
        own = groups == name
        left = normal - rows[own].T @ rows[own]
        change = np.linalg.lstsq(left, right - rows[own].T @ values[own], rcond=None)[0] - found
        total += np.outer(change, change)
    return found / unit, total * (len(names) - 1) / len(names) / np.outer(unit, unit)


def _table_rays(
    depth_m: npt.NDArray[np.float32],
    calibration: CameraCalibration,
    workspace: WorkspaceSpec,
    plane: TablePlane,
    config: DepthCheckConfig,
) -> _Rays:
    pose, every = calibration.camera_in_base, config.every
    rays = calibration.intrinsics.rays()[::every, ::every].astype(np.float64)
    height, width = rays.shape[:2]
    row, col = np.mgrid[:height, :width]
    group = (row * config.blocks // height) * config.blocks + col * config.blocks // width
    directions = rays.reshape(-1, 3) @ pose.rotation.T
    depth = depth_m[::every, ::every].reshape(-1).astype(np.float64)
    middle = np.array([workspace.x_min + workspace.x_max, workspace.y_min + workspace.y_max]) / 2.0
    with np.errstate(invalid="ignore"):
        points = directions * depth[:, None] + pose.translation
        level = plane.height + (points[:, :2] - middle) @ np.array([plane.slope_x, plane.slope_y])
        near = max(config.near, config.near_residuals * plane.residual)
        used = workspace.contains(points) & (np.abs(points[:, 2] - level) < near) & (directions[:, 2] < 0.0)
    reach = -1.0 / directions[used][:, 2]
    return _Rays(depth[used], reach, points[used], group.ravel()[used])


def _corners(depth_m: npt.NDArray[np.float32], board: BoardView, config: DepthCheckConfig) -> FloatArray:
    """Return measured and true depth (C, 2) [m] of the corners around which depth is known."""
    true = board.board_in_camera.apply(board.points)[:, 2]
    half = config.window // 2
    found = []
    for (row, col), depth in zip(np.rint(board.pixels).astype(int), true):
        part = depth_m[max(0, row - half) : row + half + 1, max(0, col - half) : col + half + 1]
        known = part[np.isfinite(part)]
        if 2 * known.size > config.window**2:
            found.append((float(np.median(known)), float(depth)))
    return np.array(found).reshape(-1, 2)


def _distance_sigma(board: BoardView, camera: CameraModel, config: DepthCheckConfig) -> float:
    """Return the standard deviation of the board's distance that its corners leave, as a share of the distance."""
    bend: Sequence[float] = camera.distortion if camera.is_distorted else (0.0,) * 5
    turn = cv2.Rodrigues(board.board_in_camera.rotation)[0]
    shift = board.board_in_camera.translation
    slope = cv2.projectPoints(board.points.reshape(-1, 1, 3), turn, shift, camera.matrix, np.asarray(bend))[1][:, :6]
    error = max(config.board_px, board.rms_px)
    covariance = error**2 * np.linalg.pinv(slope.T @ slope)
    middle = board.points.mean(axis=0)
    # the middle's depth is the third row of R x middle + t, whose slope to the turn is taken numerically
    step = 1e-6
    arm = [
        (cv2.Rodrigues(turn.ravel() + step * axis)[0] - board.board_in_camera.rotation)[2] @ middle / step
        for axis in np.eye(3)
    ]
    lever = np.array([*arm, 0.0, 0.0, 1.0])
    depth = float(board.board_in_camera.apply(middle)[2])
    return math.sqrt(float(lever @ covariance @ lever)) / depth
