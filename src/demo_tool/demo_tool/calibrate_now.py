"""The page's commands for a camera's calibration: begin, stop, and what it says as it goes on."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from demo_tool.arguments import text_of
from demo_tool.bulletin import Bulletin
from demo_tool.errors import CommandError, NotNowError
from demo_tool.ports import Calibrations

_TAKEN = re.compile(r"^(?:sample|view) (\d+) of (\d+): ")
_ERROR = "error: "
_LINES = 12  # that the page shows
_POSE = 6  # numbers of a first pose


@dataclass(frozen=True)
class CalibrationState:
    """State of a calibration, as the page shows it.

    state: none, running, stopped, failed or done; words: what counts most; lines: what was said last; share: of the
    samples that are taken.
    """

    state: str = "none"
    words: str = ""
    lines: tuple[str, ...] = ()
    share: float = 0.0

    def shown(self) -> dict[str, Any]:
        """Return the interface Calibration of static/protocol.d.ts."""
        return {"state": self.state, "words": self.words, "lines": list(self.lines), "share": self.share}


class CalibrateNow:
    """Commands `calibrate` and `stop_calibrating`."""

    def __init__(self, calibrations: Calibrations, bulletin: Bulletin) -> None:
        self._calibrations, self._bulletin = calibrations, bulletin
        self._stopped = False
        self._error = ""
        self.calibration = CalibrationState()
        self.when_idle: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {"calibrate": self._calibrate}
        self.always = {"stop_calibrating": self._stop}

    @property
    def is_running(self) -> bool:
        """True while a calibration may move the arm."""
        return self.calibration.state == "running"

    def refuse_when_running(self) -> None:
        """Refuse what would move the arm or use the camera between a calibration's motions. Raises NotNowError."""
        if self.is_running:
            raise NotNowError("the camera is being calibrated: stop that first, on the page's part Camera")

    def close(self) -> None:
        """End what runs."""
        self._calibrations.close()

    def _calibrate(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        options = _options(arguments)
        with self._bulletin.lock:
            self.refuse_when_running()
            self._stopped, self._error = False, ""
            before, self.calibration = self.calibration, CalibrationState("running", "it begins")
            try:
                self._calibrations.begin(options, self._on_line, self._on_end)
            except NotNowError:
                self.calibration = before
                raise
        return {"words": "the camera is being calibrated; Stop ends it with nothing saved"}

    def _stop(self, _: Mapping[str, Any]) -> dict[str, Any]:
        if not self.is_running:
            raise NotNowError("no calibration runs")
        self._stopped = True
        self._calibrations.stop()
        return {"words": "the calibration ends; the camera's old one stays"}

    def _on_line(self, line: str) -> None:
        with self._bulletin.lock:
            if line.startswith(_ERROR):
                self._error = line.removeprefix(_ERROR)
            taken = _TAKEN.match(line)
            share = min(1.0, int(taken[1]) / max(1, int(taken[2]))) if taken else self.calibration.share
            lines = (*self.calibration.lines, line)[-_LINES:]
            self.calibration = replace(self.calibration, words=line, lines=lines, share=share)
            self._bulletin.touch()

    def _on_end(self, status: int) -> None:
        with self._bulletin.lock:
            if status == 0:
                self.calibration = replace(self.calibration, state="done", share=1.0)
                self._bulletin.say(f"the camera is calibrated: {self.calibration.words}")
            elif self._stopped:
                self.calibration = replace(self.calibration, state="stopped", words="stopped; nothing was saved")
                self._bulletin.say("the calibration was stopped, and nothing was saved")
            else:
                words = self._error or f"it ended with status {status}: {self.calibration.words}"
                self.calibration = replace(self.calibration, state="failed", words=words)
                self._bulletin.refuse(f"the camera is not calibrated: {words}")


def _options(arguments: Mapping[str, Any]) -> list[str]:
    """Return the options of `calibrate` that a command asks for. Raises CommandError."""
    board, first = text_of(arguments, "board").strip(), text_of(arguments, "first").split()
    moves = arguments.get("move")
    if not isinstance(moves, bool):
        raise CommandError(f"'move' must be true or false, got {moves!r}")
    if board.startswith("-") or len(board) > 80:
        raise CommandError(f"'board' must be a board's form, such as charuco:5x4:40:30:4X4_50, got {board[:40]!r}")
    options = ["--board", board] if board else []
    if first and not moves:
        raise CommandError("a first pose is of a hand that is moved: tick that, or leave the pose away")
    if first:
        _check_pose(first)
        options += ["--first", *first]
    return [*options, "--move"] if moves else options


def _check_pose(words: list[str]) -> None:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != _POSE or not all(abs(number) < 1e3 for number in numbers):
        raise CommandError("the first pose must be six numbers: x, y, z [m], roll, pitch, yaw [rad] of the gripper")
