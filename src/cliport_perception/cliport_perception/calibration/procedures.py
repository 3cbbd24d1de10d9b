"""The live procedures without ROS: pictures and gripper poses in, words and at last a calibration out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from cliport_core.pose import Pose
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, record_of
from cliport_perception.calibration.collector import SampleCollector
from cliport_perception.calibration.detection import BoardDetector, Fault, Refusal
from cliport_perception.calibration.eye_on_base import solve_eye_on_base
from cliport_perception.calibration.initial_guess import guess_placement
from cliport_perception.calibration.known_board import solve_known_board
from cliport_perception.calibration.proposals import candidate_poses, describe_move, in_view, next_pose
from cliport_perception.calibration.result import SIGMAS, Acceptance, Uncertainty, Use
from cliport_perception.calibration.view import BoardView
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError

_CHECK_BOARD = "does the board lie flat and still where it is said to be, and is --board its form?"
_MORE = 5  # samples that are taken when the first ones do not suffice
_GUESS_FROM = 6  # samples from which a first solution says what will be in view


class Voice(NamedTuple):
    """The ways of words: say, for what happened; complain, for what is wrong, which each picture may repeat."""

    say: Callable[[str], None]
    complain: Callable[[str], None]


class Procedure(Protocol):
    """One way to a calibration, fed with pictures and gripper poses."""

    def on_gripper(self, stamp_ns: int, gripper_in_base: Pose) -> None:
        """Take note of where the gripper is."""

    def on_picture(self, stamp_ns: int, picture: npt.NDArray[np.uint8]) -> None:
        """Look at a picture."""

    @property
    def is_complete(self) -> bool:
        """True once there is enough to solve."""

    def solve(self, frames: tuple[str, str], made: datetime) -> CalibrationRecord:
        """Return the calibration; frames: the base's and the optical one's. Raises CalibrationError."""

    def extend(self) -> int:
        """Ask for more after a refusal, on top of what was taken; return how many, 0 where more would not help."""


class EyeOnBaseProcedure:
    """The gripper carries the board about; poses that are still missing are proposed in words.

    advises: whether somebody moves it who needs those words, and those of what moves.
    """

    def __init__(
        self,
        board: Board,
        camera: CameraModel,
        count: int,
        rng: np.random.Generator,
        voice: Voice,
        advises: bool = True,
    ) -> None:
        self._board, self._camera, self._advises = board, camera, advises
        self._count = count
        self._rng = rng
        self._say, self._complain = voice
        self._collector = SampleCollector(BoardDetector(board, camera))

    def on_gripper(self, stamp_ns: int, gripper_in_base: Pose) -> None:
        """Take note of where the gripper is."""
        self._collector.on_gripper(stamp_ns, gripper_in_base)

    def on_picture(self, stamp_ns: int, picture: npt.NDArray[np.uint8]) -> None:
        """Take a sample, or say why not."""
        got = self._collector.on_picture(stamp_ns, picture)
        if isinstance(got, Refusal):
            if self._advises or got.fault is not Fault.MOVING:
                self._complain(got.words)
            return
        number = len(self._collector.samples)
        words = f"; {self._advice()}" if self._advises else ""
        self._say(f"sample {number} of {self._count}: {got.view.rms_px:.2f} px{words}")

    @property
    def is_complete(self) -> bool:
        """True once all samples are taken."""
        return len(self._collector.samples) >= self._count

    def solve(self, frames: tuple[str, str], made: datetime) -> CalibrationRecord:
        """Return the calibration, each sample's misfit said. Raises CalibrationError when it is not good enough."""
        found = solve_eye_on_base(self._collector.samples, self._camera, self._board, self._rng)
        for number, (use, misfit) in enumerate(found.samples, start=1):
            note = "" if use is Use.FITTED else f" ({use.value})"
            self._say(f"sample {number}: {misfit.px:.2f} px, {misfit.mm:.1f} mm, {misfit.deg:.2f} deg{note}")
        percent, spread = 100 * found.scale, 100 * SIGMAS * found.scale_sigma
        self._say(f"board's size by the arm's motion: {percent:.2f} % (+-{spread:.2f})")
        self._say(in_words(found.held_out, "held out"))
        self._say(f"uncertainty ({SIGMAS:g} sigmas): {found.uncertainty.mm:.2f} mm, {found.uncertainty.deg:.3f} deg")
        Acceptance().check(found.held_out, found.uncertainty)
        return record_of(found, CameraCalibration(self._camera, found.camera_in_base), self._board, frames, made)

    def extend(self) -> int:
        """Ask for some more samples; return how many."""
        self._count = len(self._collector.samples) + _MORE
        return _MORE

    @property
    def sample_count(self) -> int:
        """The number of samples taken so far."""
        return len(self._collector.samples)

    def propose(self, tried: Sequence[Pose] = ()) -> Pose | None:
        """Return the pose of the gripper that would add most, or None while it is not known where the gripper is.

        tried: poses that were tried, beside those of the samples.
        """
        samples, current = self._collector.samples, self._collector.gripper_in_base
        if current is None:
            return None
        taken = [*(sample.gripper_in_base for sample in samples), *tried]
        candidates = candidate_poses(taken[0] if taken else current)
        if len(samples) >= _GUESS_FROM:
            with suppress(CalibrationError):  # these samples say nothing yet; the last word is the solver's
                placement, _ = guess_placement(samples, self._rng)
                candidates = in_view(candidates, placement, self._board, self._camera) or candidates
        return next_pose(candidates, taken, self._rng)

    def _advice(self) -> str:
        current, wanted = self._collector.gripper_in_base, self.propose()
        if self.is_complete or current is None or wanted is None:
            return "solving"
        return describe_move(current, wanted)


class KnownBoardProcedure:
    """The board lies still at a known place in the base frame; nothing moves."""

    def __init__(
        self, board: Board, board_in_base: Pose, camera: CameraModel, count: int, method: Method, voice: Voice
    ) -> None:
        self._board, self._board_in_base, self._camera = board, board_in_base, camera
        self._count, self._method = count, method
        self._say, self._complain = voice
        self._detector = BoardDetector(board, camera)
        self._views: list[BoardView] = []

    def on_gripper(self, stamp_ns: int, gripper_in_base: Pose) -> None:
        """Do nothing: the arm plays no part."""

    def on_picture(self, stamp_ns: int, picture: npt.NDArray[np.uint8]) -> None:
        """Take a view, or say why not."""
        got = self._detector.look(picture)
        if isinstance(got, Refusal):
            self._complain(got.words)
            return
        self._views.append(got)
        self._say(f"view {len(self._views)} of {self._count}: {got.rms_px:.2f} px")

    @property
    def is_complete(self) -> bool:
        """True once all views are taken."""
        return len(self._views) >= self._count

    def solve(self, frames: tuple[str, str], made: datetime) -> CalibrationRecord:
        """Return the calibration. Raises CalibrationError when it is not good enough."""
        found = solve_known_board(self._views, self._board_in_base, self._camera, self._board.center)
        self._say(in_words(found.misfit, "fitted"))
        at, near = found.uncertainty, found.near_board
        words = f"{near.mm:.1f} mm at the board, {at.mm:.1f} mm, {at.deg:.2f} deg at the camera"
        self._say(f"uncertainty ({SIGMAS:g} sigmas): {words}; the error of the board's own place adds to it")
        if near.mm > Acceptance().mm:
            self._complain(f"that is more than {Acceptance().mm:g} mm: a board that the gripper carries does better")
        # What one view leaves open is said, not refused.
        Acceptance().check(found.misfit, Uncertainty(0.0, 0.0), "misfit", _CHECK_BOARD)
        lens = CameraCalibration(self._camera, found.camera_in_base)
        views = len(self._views)
        return CalibrationRecord(lens, made, self._method, *frames, self._board, views, (), found.misfit, None, at)

    def extend(self) -> int:
        """Return 0: more of the same views would say the same."""
        return 0


def in_words(misfit: tuple[float, float, float], name: str) -> str:
    """Return a misfit in words."""
    px, mm, deg = misfit
    return f"{name}: {px:.2f} px (root mean square), {mm:.2f} mm and {deg:.3f} deg (medians)"
