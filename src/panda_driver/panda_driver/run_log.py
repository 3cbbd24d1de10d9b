"""Log of the motions of an arm and its hand: what was asked for, what was measured, and how each ended."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from panda_driver.errors import DriverError

FORMAT = 1
ENDS = {4: "succeeded", 5: "canceled", 6: "aborted"}  # of action_msgs/GoalStatus
_WITH_FEEDBACK = ("arm", "hand")
_MOST_SAMPLES = 6000  # of one motion: a minute at 100 Hz


@dataclass(frozen=True)
class Sample:
    """A moment of a motion.

    time: since its beginning [s]; desired, measured: positions [rad; m of the hand's width], or none; effort: by joint
    [N m; N of the hand], or none.
    """

    time: float
    desired: tuple[float, ...]
    measured: tuple[float, ...]
    effort: tuple[float, ...]


@dataclass(eq=False)
class RunningMotion:
    """A goal that is running.

    part: "arm", "hand", or one of franka_msgs' actions ("grasp", "move", "homing"); began: ROS time [s].
    """

    goal: str
    part: str
    began: float
    samples: list[Sample] = field(default_factory=list)

    def ended(self, at: float, end: str) -> dict[str, Any]:
        """Return the motion as plain values, ready for JSON; at: ROS time [s]."""
        return {
            "goal": self.goal,
            "part": self.part,
            "began": round(self.began, 4),
            "seconds": round(at - self.began, 4),
            "end": end,
            "worst_error": _worst_error(self.samples),
            "greatest_effort": _greatest_effort(self.samples),
            "samples": [
                [round(s.time, 4), _rounded(s.desired), _rounded(s.measured), _rounded(s.effort)] for s in self.samples
            ],
        }


class RunLog:
    """Motions of a run, each written to a file of JSON lines when it ends.

    Args:
        path: of that file, which must not exist.
        say: told a line about each motion.

    Raises:
        DriverError: when the file exists or cannot be written.
    """

    def __init__(self, path: Path, head: Mapping[str, Any], say: Callable[[str], None]) -> None:
        self._path, self._say = path, say
        self._running: dict[str, RunningMotion] = {}
        self._ended: set[str] = set()
        self._efforts: tuple[float, ...] = ()
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(json.dumps({"format": FORMAT, **head}) + "\n")
        except OSError as error:
            raise DriverError(f"cannot write {path} ({error.strerror}): choose another --out") from None

    def on_efforts(self, efforts: Sequence[float]) -> None:
        """Take the newest efforts of the arm's joints [N m]; they go with its next samples."""
        self._efforts = tuple(efforts)

    def on_feedback(
        self,
        goal: str,
        part: str,
        now: float,
        desired: Sequence[float],
        measured: Sequence[float],
        effort: Sequence[float],
    ) -> None:
        """Take a moment of a motion at ROS time `now` [s]; effort: of the hand; the arm's come by `on_efforts`."""
        if goal in self._ended:
            return
        motion = self._running.setdefault(goal, RunningMotion(goal, part, now))
        if len(motion.samples) < _MOST_SAMPLES:
            given = self._efforts if part == "arm" else tuple(effort)
            motion.samples.append(Sample(now - motion.began, tuple(desired), tuple(measured), given))

    def on_width(self, now: float, width: float) -> None:
        """Take the measured width between the fingers [m]: a moment of what runs without feedback of its own."""
        for motion in self._running.values():
            if motion.part not in _WITH_FEEDBACK and len(motion.samples) < _MOST_SAMPLES:
                motion.samples.append(Sample(now - motion.began, (), (width,), ()))

    def on_status(self, goal: str, part: str, now: float, status: int) -> None:
        """Take a goal's status, as action_msgs/GoalStatus numbers it."""
        if goal in self._ended:
            return
        if status not in ENDS:
            self._running.setdefault(goal, RunningMotion(goal, part, now))
            return
        motion = self._running.pop(goal, None)
        self._ended.add(goal)
        if motion is not None:  # else it ended before the recording began
            self._write(motion, now, ENDS[status])

    def close(self, now: float) -> None:
        """Write what is still running, as `unfinished`."""
        while self._running:
            self._write(self._running.popitem()[1], now, "unfinished")

    def _write(self, motion: RunningMotion, now: float, end: str) -> None:
        values = motion.ended(now, end)
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(values) + "\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise DriverError(f"cannot write {self._path} ({error.strerror})") from None
        error_words = "" if values["worst_error"] is None else f", at most {values['worst_error']:.4f} off"
        self._say(f"{motion.part} {end} after {values['seconds']:.2f} s, {len(motion.samples)} samples{error_words}")


def _worst_error(samples: Sequence[Sample]) -> float | None:
    """Return the greatest distance of a joint from where it was to be, None where nothing says so."""
    errors = [
        abs(wanted - found)
        for s in samples
        if len(s.desired) == len(s.measured)
        for wanted, found in zip(s.desired, s.measured, strict=True)
    ]
    finite = [error for error in errors if math.isfinite(error)]
    return round(max(finite), 6) if finite else None


def _greatest_effort(samples: Sequence[Sample]) -> list[float] | None:
    """Return the greatest effort of each joint, whatever its sign; None where none is known."""
    known = [s.effort for s in samples if s.effort]
    if not known:
        return None
    return [round(max(abs(effort[joint]) for effort in known), 4) for joint in range(min(map(len, known)))]


def _rounded(values: Sequence[float]) -> list[float | None]:
    return [round(value, 6) if math.isfinite(value) else None for value in values]
