"""A board at a known place on the table: told, or found by touching three of its corners with the gripper."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from cliport_core.pose import FloatArray, Pose
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.refinement import fit_pose
from cliport_perception.calibration.result import Misfit, Uncertainty
from cliport_perception.calibration.view import BoardView, rms_of
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError

CORNERS = ("top left", "top right", "bottom right", "bottom left")  # of the pattern, as it is read
_MAX_MISFIT_PX = 2.0
_MAX_TOUCH_ERROR = 0.003  # by which touched points may miss the board's form [m]


class KnownBoardResult(NamedTuple):
    """Camera in base; its misfit; how uncertain the pixels leave it, and a point at the board's middle."""

    camera_in_base: Pose
    misfit: Misfit
    uncertainty: Uncertainty
    near_board: Uncertainty


def solve_known_board(
    views: Sequence[BoardView], board_in_base: Pose, camera: CameraModel, center: FloatArray
) -> KnownBoardResult:
    """Return where a still camera is that sees the board at board_in_base; center: the board's middle (3,) [m].

    The uncertainty is that of the pixels; an error of the board's place comes on top.

    Raises:
        CalibrationError: without views, or when they do not agree: the camera or the board moved.
    """
    if not views:
        raise CalibrationError("no view of the board: take one at least")
    start = board_in_base @ views[0].board_in_camera.inverse()
    points = np.concatenate([board_in_base.apply(view.points) for view in views])
    pixels = np.concatenate([view.pixels for view in views])

    def residuals(camera_in_base: Pose) -> FloatArray:
        return (camera.project(camera_in_base.inverse().apply(points)) - pixels).ravel()

    pose, covariance = fit_pose(residuals, start, len(views))  # what errs, errs alike in every picture
    middle = Pose(np.eye(3), center)
    drawn = pose.inverse() @ board_in_base @ middle
    apart = [pose_difference(drawn, view.board_in_camera @ middle) for view in views]
    px = rms_of(residuals(pose).reshape(-1, 2))
    mm, deg = np.median(np.array(apart), axis=0)
    if px > _MAX_MISFIT_PX:
        raise CalibrationError(f"the views disagree by {px:.1f} px: camera and board must stand still; begin again")
    misfit = Misfit(px, float(mm), float(deg))
    near = _carried(covariance, board_in_base.apply(center) - pose.translation)
    return KnownBoardResult(pose, misfit, Uncertainty.of_covariance(covariance), Uncertainty.of_covariance(near))


def _carried(covariance: FloatArray, arm: FloatArray) -> FloatArray:
    """Return the covariance (6, 6) of a pose as it is for a point at the end of a lever (3,) [m]."""
    x, y, z = arm
    lever = np.eye(6)
    lever[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    carried: FloatArray = lever @ covariance @ lever.T
    return carried


def board_from_touches(board: Board, touched: npt.ArrayLike) -> Pose:
    """Return board in base of where the gripper's tip touched three corners of the pattern, or all four.

    touched: (3, 3) or (4, 3) in the base frame [m], of `CORNERS` in that order.

    Raises:
        CalibrationError: when the points do not have the board's form, naming by how much.
    """
    points = np.asarray(touched, dtype=np.float64)
    if points.ndim != 2 or points.shape[0] not in (3, 4) or points.shape[1] != 3 or not np.isfinite(points).all():
        raise CalibrationError(f"three or four touched points of x, y, z are needed, got {points.tolist()}")
    outline = board.outline[: len(points)]
    turn, _ = Rotation.align_vectors(points - points.mean(axis=0), outline - outline.mean(axis=0))
    rotation = turn.as_matrix()
    pose = Pose(rotation, points.mean(axis=0) - rotation @ outline.mean(axis=0))
    worst = np.linalg.norm(pose.apply(outline) - points, axis=1)
    if worst.max() > _MAX_TOUCH_ERROR:
        name = CORNERS[int(worst.argmax())]
        raise CalibrationError(
            f"the touched points miss the board's form by {1e3 * worst.max():.1f} mm at its {name} corner (at most "
            f"{1e3 * _MAX_TOUCH_ERROR:.0f}): touch {', '.join(CORNERS[: len(points)])} in this order"
        )
    return pose
