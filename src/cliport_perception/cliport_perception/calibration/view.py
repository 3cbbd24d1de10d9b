"""One sighting of a board: its corners in a picture, and where that puts it before the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.pose import FloatArray, Pose
from cliport_perception.camera_model import CameraModel


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners that were measured in one picture.

    points: (N, 3) in the board's frame [m]; pixels: (N, 2) as (row, col), fractional; board_in_camera: the pose that
    explains them best, in the optical frame; rms_px: how well it does.
    """

    points: FloatArray
    pixels: FloatArray
    board_in_camera: Pose
    rms_px: float

    def tilt(self, center: npt.ArrayLike) -> float:
        """Return the angle [rad] between the board's normal and the line of sight to a point (3,) of the board."""
        sight = self.board_in_camera.apply(center)
        cosine = float(self.board_in_camera.rotation[:, 2] @ sight / np.linalg.norm(sight))
        return math.acos(min(1.0, max(-1.0, cosine)))


def fit_view(points: FloatArray, pixels: FloatArray, camera: CameraModel) -> BoardView | None:
    """Return the view of corners (N, 3) [m] at pixels (N, 2) as (row, col), or None when no pose explains them."""
    if len(points) < 4:
        return None
    image = np.ascontiguousarray(pixels[:, ::-1]).reshape(-1, 1, 2)
    lens = _coefficients(camera)
    try:
        found, rotations, shifts, _ = cv2.solvePnPGeneric(
            points.reshape(-1, 1, 3), image, camera.matrix, lens, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return None
    best: BoardView | None = None
    for turn, shift in zip(rotations[:found], shifts[:found]):
        turn, shift = cv2.solvePnPRefineLM(points.reshape(-1, 1, 3), image, camera.matrix, lens, turn, shift)
        if not (np.isfinite(turn).all() and np.isfinite(shift).all()) or shift[2, 0] <= 0.0:
            continue
        pose = Pose(cv2.Rodrigues(turn)[0], shift.ravel())
        rms = rms_of(camera.project(pose.apply(points)) - pixels)
        if best is None or rms < best.rms_px:
            best = BoardView(points, pixels, pose, rms)
    return best


def rms_of(errors: FloatArray) -> float:
    """Return the root mean square length of rows (N, 2) [px]."""
    return float(np.sqrt(np.mean(np.sum(errors * errors, axis=-1))))


def _coefficients(camera: CameraModel) -> FloatArray:
    return np.asarray(camera.distortion) if camera.is_distorted else np.zeros(5)
