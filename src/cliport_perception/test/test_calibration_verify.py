"""The check of a calibration: numbers that move with the error, and a picture that shows it."""

from __future__ import annotations

import numpy as np
import pytest

from cliport_core import Pose, WorkspaceSpec
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.verification import Frame, draw, verify
from cliport_perception.calibration.view import fit_view
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.errors import CalibrationError

WORKSPACE = WorkspaceSpec()
LYING = Pose.from_xyz_rpy((0.35, 0.15, 0.0), (np.pi, 0.0, 0.3))


def frame(scene, tip=None) -> Frame:
    board = Board()
    points = np.asarray(board.cv_board.getChessboardCorners(), dtype=np.float64)
    pixels = scene.camera.project((scene.camera_in_base.inverse() @ LYING).apply(points))
    return Frame(scene.color, scene.depth, tip, fit_view(points, pixels, scene.camera))


def test_a_right_calibration_has_small_numbers(box_scene) -> None:
    calibration = CameraCalibration(box_scene.camera, box_scene.camera_in_base)
    seen = frame(box_scene, np.array([0.42, -0.08, 0.045]))  # 5 mm above the cube
    found = verify(seen, calibration, WORKSPACE, Board())
    assert found.plane is not None and abs(found.plane.height) < 5e-4
    assert found.tip_mm == pytest.approx(5.0, abs=0.5)
    assert found.board_mm is not None and np.abs(found.board_mm).max() < 0.1
    assert len(found.in_words()) == 3 and found.in_words()[0].startswith("table: +0.0 mm")
    picture = draw(found, seen, calibration, Board())
    assert picture.shape == (960, 480, 3) and picture.dtype == np.uint8
    assert (picture == (255, 255, 0)).all(axis=-1).any() and (picture == (0, 255, 0)).all(axis=-1).any()
    row, col = WORKSPACE.xy_to_pixel(0.42, -0.08)
    assert tuple(picture[3 * row + 1, 3 * col + 1]) == (255, 255, 0), "the cross is not where the tip is"


def test_a_wrong_calibration_is_seen_in_them(box_scene) -> None:
    off = Pose(box_scene.camera_in_base.rotation, box_scene.camera_in_base.translation + np.array([0.0, 0.0, 0.01]))
    calibration = CameraCalibration(box_scene.camera, off)
    seen = frame(box_scene, np.array([0.42, -0.08, 0.045]))
    found = verify(seen, calibration, WORKSPACE, Board())
    assert found.plane is not None and found.plane.height == pytest.approx(0.01, abs=5e-4)
    assert found.board_mm is not None and found.board_mm == pytest.approx(10.0, abs=0.1)
    true = CameraCalibration(box_scene.camera, box_scene.camera_in_base)
    red = []
    for used in (calibration, true):
        picture = draw(verify(seen, used, WORKSPACE, Board()), seen, used, Board()).astype(int)
        red.append(int((picture[..., 0] - picture[..., 2] > 60).sum()))
    assert red[0] > 5 * red[1]


@pytest.mark.parametrize("up", [0.05, 0.15])
def test_a_calibration_that_is_far_off_has_its_number(box_scene, up: float) -> None:
    off = Pose(box_scene.camera_in_base.rotation, box_scene.camera_in_base.translation + np.array([0.0, 0.0, up]))
    found = verify(frame(box_scene), CameraCalibration(box_scene.camera, off), WORKSPACE, Board())
    assert found.in_words()[0].startswith(f"table: {1e3 * up:+.1f} mm from z = 0")


def test_what_is_not_seen_is_said(box_scene) -> None:
    calibration = CameraCalibration(box_scene.camera, box_scene.camera_in_base)
    nothing = np.full_like(box_scene.depth, np.nan)
    with pytest.raises(CalibrationError, match="nothing of the workspace is seen"):
        verify(Frame(box_scene.color, nothing), calibration, WORKSPACE, Board())
    found = verify(Frame(box_scene.color, box_scene.depth), calibration, WORKSPACE, Board())
    assert found.tip_mm is None and found.board_mm is None and "no surface is seen" in found.in_words()[1]
