"""The taking of views for a lens: the board everywhere in the picture, tilted every way; what is missing in words."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cliport_perception.calibration.board import Board
from cliport_perception.calibration.collector import shift_px
from cliport_perception.calibration.detection import BoardDetector, Refusal, ViewLimits
from cliport_perception.calibration.lens_solver import LensFit, solve_lens
from cliport_perception.calibration.procedures import Voice
from cliport_perception.calibration.result import SIGMAS
from cliport_perception.calibration.view import BoardView
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError

_COLUMNS, _ROWS = ("left", "middle left", "middle right", "right"), ("upper", "middle", "lower")
_TILTED = math.sin(math.radians(15.0))  # of the board's normal to one side, from which it counts as tilted there
_TILTS_EACH = 2  # views tilted to each side
_STEADY_PX = 0.7  # by which the board may move from one picture to the next
_NEW_SHARE, _NEW_TURN = 0.04, math.radians(8.0)  # of the picture's width; a view must differ by one of them
_LEAST, _MORE = 15, 5  # views that are asked for, at first and after a refusal
_ROUGH_FOCAL = 0.9  # of an unknown lens, as a share of the picture's width: no more than tilts depend on it
_ROUGH_RMS = 50.0  # by which a board may seem bent through it [px]


class LensProcedure:
    """A board is moved before a camera whose lens nobody knows; count: of the views, at least."""

    def __init__(self, board: Board, count: int, voice: Voice) -> None:
        self._board, self._count = board, count
        self._say, self._complain = voice
        self._detector: BoardDetector | None = None
        self._size = (0, 0)
        self._last: BoardView | None = None
        self.views: list[BoardView] = []

    def on_picture(self, picture: npt.NDArray[np.uint8]) -> None:
        """Take a view, or say why not. Raises ImageError when the pictures' size has changed."""
        if self._detector is None:
            self._size = picture.shape[0], picture.shape[1]
            self._detector = BoardDetector(self._board, rough_camera(*self._size), ViewLimits(max_rms_px=_ROUGH_RMS))
        got = self._detector.look(picture)
        if isinstance(got, Refusal):
            self._last = None
            self._complain(got.words)
            return
        before, self._last = self._last, got
        if before is None or shift_px(before, got) > _STEADY_PX:
            self._complain("the board is seen: hold it still")
        elif self._is_known(got):
            self._complain(f"this view is taken; {self.missing() or 'move the board on'}")
        else:
            self.views.append(got)
            missing = self.missing()
            self._say(f"view {len(self.views)} of {self._count}" + (f"; {missing}" if missing else ""))

    def missing(self) -> str:
        """Return in words which view would add most; empty where all of the picture and all tilts are there."""
        for name, side in (("left", 0), ("right", 0), ("upper", 1), ("lower", 1)):
            sign = 1.0 if name in ("right", "lower") else -1.0
            if sum(sign * view.board_in_camera.rotation[side, 2] > _TILTED for view in self.views) < _TILTS_EACH:
                return f"tilt the board: bring its {name} edge towards the camera by 20 to 40 degrees"
        empty = np.argwhere(self._seen() == 0)
        if not len(empty):
            return ""
        row, col = empty[0]
        return f"bring the board into the picture's {_ROWS[row]} {_COLUMNS[col]} part"

    @property
    def is_complete(self) -> bool:
        """True once there are enough views, and nothing is missing."""
        return len(self.views) >= self._count and not self.missing()

    def solve(self) -> LensFit:
        """Return the lens, its figures said. Raises CalibrationError when it is not good enough."""
        found = solve_lens(self.views, self._size)
        camera, sigmas = found.camera, [SIGMAS * sigma for sigma in found.sigmas]
        self._say(f"{len(self.views)} views, {len(found.odd)} of them odd and left out")
        self._say(f"fitted: {found.fitted_px:.2f} px, held out: {found.held_out_px:.2f} px (root mean squares)")
        values = (camera.fx, camera.fy, camera.cx, camera.cy)
        for name, value, open_by in zip(("fx", "fy", "cx", "cy"), values, sigmas, strict=True):
            self._say(f"{name}: {value:.2f} px (+-{open_by:.2f}, {SIGMAS:g} sigmas)")
        self._say(f"distortion (plumb_bob): {', '.join(f'{v:.4f}' for v in camera.distortion)}")
        return found

    def extend(self) -> int:
        """Ask for some more views; return how many."""
        self._count = len(self.views) + _MORE
        return _MORE

    def _seen(self) -> npt.NDArray[np.int64]:
        """Return how many corners were seen in each part (rows, columns) of the picture."""
        pixels = np.concatenate([view.pixels for view in self.views]) if self.views else np.zeros((0, 2))
        bins = [len(_ROWS), len(_COLUMNS)]
        bounds = [(0, self._size[0] or 1), (0, self._size[1] or 1)]
        return np.histogram2d(pixels[:, 0], pixels[:, 1], bins, bounds)[0].astype(np.int64)

    def _is_known(self, view: BoardView) -> bool:
        for other in self.views:
            cosine = float(view.board_in_camera.rotation[:, 2] @ other.board_in_camera.rotation[:, 2])
            turned = math.acos(min(1.0, max(-1.0, cosine)))
            if turned < _NEW_TURN and shift_px(other, view) < _NEW_SHARE * self._size[1]:
                return True
        return False


def rough_camera(rows: int, cols: int) -> CameraModel:
    """Return a lens that may stand for an unknown one where only tilts are judged."""
    focal = _ROUGH_FOCAL * cols
    return CameraModel(cols, rows, focal, focal, (cols - 1) / 2.0, (rows - 1) / 2.0)


def check_count(count: int) -> None:
    """Check how many views are asked for. Raises CalibrationError."""
    if count < _LEAST:
        raise CalibrationError(f"--samples must be {_LEAST} or more for a lens, got {count}")
