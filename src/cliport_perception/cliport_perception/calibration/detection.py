"""The search for a board in pictures, and the words for what is wrong with one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.errors import ImageError
from cliport_core.pose import FloatArray
from cliport_perception.calibration.board import Board, BoardKind, dictionary, dictionary_names
from cliport_perception.calibration.view import BoardView, fit_view
from cliport_perception.camera_model import CameraModel

_LOOK_ELSEWHERE = 10  # of pictures without the board, one is searched for all other dictionaries, which takes long
_LEAST_SQUARES = 3  # undecoded ones that may be a board's

GrayImage = npt.NDArray[np.uint8]


class Fault(Enum):
    """Reasons why a picture gives no view."""

    NOT_SEEN = "not seen"
    WRONG_DICTIONARY = "wrong dictionary"
    TOO_FEW = "too few corners"
    TOO_OBLIQUE = "too oblique"
    TOO_FAR = "too far"
    BLURRED = "blurred"
    INCONSISTENT = "inconsistent"
    MOVING = "moving"
    NO_ARM = "no arm"


class Refusal(NamedTuple):
    """A picture that gives no view: the reason, and one line with its remedy."""

    fault: Fault
    words: str


@dataclass(frozen=True)
class ViewLimits:
    """Limits of a good view.

    min_corner_share: of all corners, seen. max_tilt: angle between the board's normal and the line of sight [rad].
    min_marker_px: side of a marker. max_edge_px: pixels over which black turns to white, about 2 in a sharp picture.
    max_rms_px: misfit of the corners to a flat board through this lens.
    """

    min_corner_share: float = 0.5
    max_tilt: float = math.radians(60.0)
    min_marker_px: float = 12.0
    max_edge_px: float = 6.0
    max_rms_px: float = 1.5


class BoardDetector:
    """Finds one board in the pictures of one camera."""

    def __init__(self, board: Board, camera: CameraModel, limits: ViewLimits | None = None) -> None:
        self.board = board
        self.camera = camera
        self.limits = limits or ViewLimits()
        self._markers = cv2.aruco.ArucoDetector(dictionary(board.dictionary), _parameters())
        self._unseen_pictures = 0
        self._other: str | None = None
        self._charuco = None
        if board.kind is BoardKind.CHARUCO:
            charuco = cv2.aruco.CharucoParameters()
            charuco.minMarkers = 1
            self._charuco = cv2.aruco.CharucoDetector(
                board.cv_board, charuco, _parameters(0.3)
            )  # its own corners count

    def look(self, picture: npt.NDArray[np.uint8]) -> BoardView | Refusal:
        """Return the view that a picture, (H, W) grey or (H, W, 3) RGB, gives of the board, or why it gives none.

        Raises:
            ImageError: when the picture does not have the camera's size.
        """
        if picture.shape[:2] != (self.camera.height, self.camera.width):
            size = (self.camera.height, self.camera.width)
            raise ImageError(f"the picture is {picture.shape[:2]}, camera_info says {size} (rows, columns)")
        gray = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) if picture.ndim == 3 else picture
        corners, ids, undecoded = self._markers.detectMarkers(gray)
        own = [] if ids is None else [c for c, i in zip(corners, ids.ravel()) if i < self._marker_count]
        if not own:
            return self._unseen(gray, undecoded)
        self._unseen_pictures, self._other = 0, None
        side = float(np.median([math.sqrt(cv2.contourArea(marker)) for marker in own]))
        if side < self.limits.min_marker_px:
            least = self.limits.min_marker_px
            words = f"the board is too far: its markers are {side:.0f} px wide, at least {least:.0f} needed"
            return Refusal(Fault.TOO_FAR, f"{words}; bring it closer or print a larger one")
        return self._judged(gray, *self._corners(gray, corners, ids))

    @property
    def _marker_count(self) -> int:
        return len(self.board.cv_board.getIds())

    def _corners(self, gray: GrayImage, corners: Any, ids: Any) -> tuple[FloatArray, FloatArray]:
        """Return points (N, 3) [m] of the board and their pixels (N, 2) as (row, col)."""
        if self._charuco is not None:
            corners, ids, _, _ = self._charuco.detectBoard(gray)
        if ids is None or not len(ids):
            return np.zeros((0, 3)), np.zeros((0, 2))
        points, image = self.board.cv_board.matchImagePoints(corners, ids)
        if points is None:
            return np.zeros((0, 3)), np.zeros((0, 2))
        pixels = np.asarray(image, dtype=np.float64).reshape(-1, 2)[:, ::-1]
        return np.asarray(points, dtype=np.float64).reshape(-1, 3), pixels

    def _judged(self, gray: GrayImage, points: FloatArray, pixels: FloatArray) -> BoardView | Refusal:
        limits, needed = self.limits, max(4, math.ceil(self.limits.min_corner_share * self.board.corner_count))
        width = edge_width(gray, pixels) if len(pixels) else 0.0
        if width > limits.max_edge_px:
            return Refusal(Fault.BLURRED, self._blurred(width))
        if len(points) < needed:
            words = f"{len(points)} of the board's {self.board.corner_count} corners are seen, at least {needed} needed"
            return Refusal(Fault.TOO_FEW, f"{words}; bring all of it into the picture, uncovered and evenly lit")
        view = fit_view(points, pixels, self.camera)
        if view is None or view.rms_px > limits.max_rms_px:
            misfit = "no pose" if view is None else f"{view.rms_px:.1f} px"
            words = f"the corners do not lie on a flat board ({misfit}, {limits.max_rms_px:g} px at most)"
            return Refusal(
                Fault.INCONSISTENT, f"{words}; flatten the sheet, and check camera_info and the board's form"
            )
        tilt = view.tilt(self.board.center)
        if tilt > limits.max_tilt:
            degrees = math.degrees(tilt)
            words = f"the board is too oblique: {degrees:.0f} degrees, {math.degrees(limits.max_tilt):.0f} at most"
            return Refusal(Fault.TOO_OBLIQUE, f"{words}; turn its face towards the camera")
        return view

    def _blurred(self, width: float) -> str:
        words = f"the picture is blurred: edges are {width:.1f} px wide, {self.limits.max_edge_px:.0f} at most"
        return f"{words}; wait until nothing moves, focus, or add light"

    def _unseen(self, gray: GrayImage, undecoded: Sequence[FloatArray]) -> Refusal:
        if len(undecoded) >= _LEAST_SQUARES:
            corners = np.concatenate([square.reshape(-1, 2)[:, ::-1] for square in undecoded])
            width = edge_width(gray, corners)
            if width > self.limits.max_edge_px:
                return Refusal(Fault.BLURRED, self._blurred(width))
        if self._unseen_pictures % _LOOK_ELSEWHERE == 0:
            self._other = other_dictionary(gray, self.board)
        self._unseen_pictures += 1
        if self._other is not None:
            words = f"the board's markers are of dictionary {self._other}, not of {self.board.dictionary}"
            return Refusal(Fault.WRONG_DICTIONARY, f"{words}; name {self._other} in --board, or print this board")
        words = f"the board is not seen: no marker of {self.board.dictionary}"
        return Refusal(Fault.NOT_SEEN, f"{words}; bring it into the picture, uncovered, in focus and evenly lit")


def other_dictionary(gray: GrayImage, board: Board) -> str | None:
    """Return the name of the dictionary whose markers a picture shows in a board's place, or None."""
    least = 1 if board.kind is BoardKind.ARUCO else 3
    best, most = None, least - 1
    names = sorted(dictionary_names(), key=lambda name: len(dictionary(name).bytesList))
    for name in names:
        if name == board.dictionary:
            continue
        _, ids, _ = cv2.aruco.ArucoDetector(dictionary(name), _parameters()).detectMarkers(gray)
        count = 0 if ids is None else len({int(i) for i in ids.ravel()})
        if count > most:
            best, most = name, count
    return best


def edge_width(gray: GrayImage, pixels: FloatArray) -> float:
    """Return over how many pixels black turns to white at the steepest edges around corners (N, 2) as (row, col)."""
    top, left = np.floor(pixels.min(axis=0) - 4).astype(int).clip(0)
    bottom, right = np.ceil(pixels.max(axis=0) + 5).astype(int)
    part = gray[top:bottom, left:right].astype(np.float32)
    if min(part.shape) < 8:
        return 0.0
    part = cv2.GaussianBlur(part, (3, 3), 0.6)  # less of the sensor's grain
    low, high = np.percentile(part, (5.0, 95.0))
    slope = cv2.magnitude(cv2.Sobel(part, cv2.CV_32F, 1, 0), cv2.Sobel(part, cv2.CV_32F, 0, 1)) / 8.0
    steepest = float(np.percentile(slope, 98.0))
    return float(high - low) / max(steepest, 1e-6)


def _parameters(relative_window: float = 0.8) -> cv2.aruco.DetectorParameters:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = 4
    parameters.relativeCornerRefinmentWinSize = relative_window
    parameters.minMarkerPerimeterRate = 0.02  # of a far board in a wide picture
    return parameters
