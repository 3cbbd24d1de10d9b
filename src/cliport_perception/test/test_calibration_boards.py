"""Boards and the pictures of them: found where they are, and in words why not."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from cliport_core import ImageError, Pose
from cliport_perception import CameraModel
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.board import Board, board_from_dict, parse_board
from cliport_perception.calibration.detection import BoardDetector, Fault, Refusal
from cliport_perception.calibration.synthetic import PictureConfig, SyntheticCamera
from cliport_perception.calibration.view import BoardView
from cliport_perception.errors import CalibrationError

CAMERA = CameraModel(640, 360, 420.0, 421.0, 322.0, 178.0, "plumb_bob", (0.08, -0.1, 0.001, -0.0005, 0.0))
TEXTS = ("charuco:5x4:40:30:4X4_50", "aprilgrid:4x3:50:40:APRILTAG_36H11", "aruco:150:4X4_50")


def facing(board: Board, z: float = 0.6, tilt: float = 0.4) -> Pose:
    """The board's middle before the lens, tilted about two axes."""
    pose = Pose.from_xyz_rpy((0.02, -0.01, z), (tilt, 0.6 * tilt, 0.1))
    return pose @ Pose(np.eye(3), -board.center)


def look(board: Board, pose: Pose, config: PictureConfig | None = None, shown: Board | None = None):
    picture = SyntheticCamera(shown or board, CAMERA, config).picture(pose, np.random.default_rng(0))
    return BoardDetector(board, CAMERA).look(picture)


@pytest.mark.parametrize("text", TEXTS)
def test_boards_are_read_as_they_are_written(text: str) -> None:
    board = parse_board(text)
    assert board.describe() in (text, text.replace("150", "1x1:150:150"))
    assert board_from_dict(board.to_dict()) == board
    height, width = board.picture(1000.0).shape
    assert (width / 1000, height / 1000) == pytest.approx(board.size, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [("chess:5x4:40:30", "describes no board"), ("charuco:5x4:40", "describes no board"),
     ("charuco:5x4:30:40", "no larger than its pitch"), ("charuco:2x2:40:30", "3x3 squares at least"),
     ("charuco:5x4:40:30:4X4_7", "unknown marker dictionary '4X4_7'; known are 4X4_100"),
     ("charuco:15x14:40:30:4X4_50", "needs 105 markers, and 4X4_50 has 50"),
     ("charuco:5x4:nan:30", "must be positive"), ("aprilgrid:1x1:50:40", "two tags at least")],
)  # fmt: skip
def test_what_is_no_board_is_refused_in_one_line(text: str, words: str) -> None:
    with pytest.raises(CalibrationError, match=words) as caught:
        parse_board(text)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", TEXTS)
def test_a_board_is_found_where_it_is(text: str) -> None:
    board = parse_board(text)
    truth = facing(board)
    view = look(board, truth)
    assert isinstance(view, BoardView), view
    assert len(view.points) == board.corner_count
    error = CAMERA.project(truth.apply(view.points)) - view.pixels
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.35
    assert abs(error.mean(axis=0)).max() < 0.1, "corners lie half a pixel off"
    middle = view.board_in_camera.apply(board.center) - truth.apply(board.center)
    assert np.linalg.norm(middle) < 0.004 and pose_difference(view.board_in_camera, truth)[1] < 1.5


def test_colour_pictures_are_read_too() -> None:
    board = Board()
    gray = SyntheticCamera(board, CAMERA).picture(facing(board), np.random.default_rng(0))
    detector = BoardDetector(board, CAMERA)
    view, same = detector.look(gray), detector.look(cv2.cvtColor(gray, cv2.COLOR_GRAY2RGB))
    assert isinstance(view, BoardView) and isinstance(same, BoardView)
    np.testing.assert_allclose(view.pixels, same.pixels, atol=1e-6)


@pytest.mark.parametrize(
    ("pose", "config", "fault", "words"),
    [(facing(Board(), z=-1.0), None, Fault.NOT_SEEN, "no marker of 4X4_50; bring it into the picture"),
     (facing(Board(), z=1.15, tilt=0.1), None, Fault.TOO_FAR, "too far: its markers are"),
     (facing(Board(), z=0.4, tilt=1.0), None, Fault.TOO_OBLIQUE, "too oblique"),
     (facing(Board(), z=0.35, tilt=0.2), PictureConfig(blur_px=3.2), Fault.BLURRED, "blurred: edges are"),
     (facing(Board(), z=0.5) @ Pose(np.eye(3), np.array([0.35, 0.0, 0.0])), None, Fault.TOO_FEW, "of the board's 12")],
)  # fmt: skip
def test_what_is_wrong_is_said(pose: Pose, config: PictureConfig | None, fault: Fault, words: str) -> None:
    refusal = look(Board(), pose, config)
    assert isinstance(refusal, Refusal), refusal
    assert refusal.fault is fault and words in refusal.words and "\n" not in refusal.words


@pytest.mark.parametrize("text", TEXTS)
def test_a_board_of_another_dictionary_is_named(text: str) -> None:
    board = parse_board(text)
    other = parse_board(text.replace("4X4_50", "6X6_250").replace("APRILTAG_36H11", "APRILTAG_16H5"))
    refusal = look(board, facing(board), shown=other)
    assert isinstance(refusal, Refusal) and refusal.fault is Fault.WRONG_DICTIONARY
    found = refusal.words.split("dictionary ")[1].split(",")[0]
    assert found.split("_")[0] == other.dictionary.split("_")[0]


def test_a_bent_sheet_or_a_wrong_lens_is_noticed() -> None:
    board = Board()
    picture = SyntheticCamera(board, CAMERA).picture(facing(board, z=0.4), np.random.default_rng(0))
    wrong = CameraModel(640, 360, 420.0, 421.0, 322.0, 178.0, "plumb_bob", (1.5, 9.0, 0.1, 0.1, 0.0))
    refusal = BoardDetector(board, wrong).look(picture)
    assert isinstance(refusal, Refusal) and refusal.fault is Fault.INCONSISTENT


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(ImageError, match="camera_info says"):
        BoardDetector(Board(), CAMERA).look(np.zeros((480, 640), np.uint8))


def test_tilt_is_that_of_the_board_to_the_line_of_sight() -> None:
    board = Board()
    view = look(board, facing(board, z=0.5, tilt=0.0))
    assert isinstance(view, BoardView)
    assert view.tilt(board.center) < math.radians(6.0)
