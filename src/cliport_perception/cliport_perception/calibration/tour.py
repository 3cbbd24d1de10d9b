"""A tour of the hand from pose to pose, on which a procedure takes its samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import Pose
from cliport_perception.calibration.proposals import describe_pose
from cliport_perception.errors import CalibrationError

Propose = Callable[[Sequence[Pose]], Pose | None]  # the next pose of the gripper, given those that were tried


class Mover(Protocol):
    """A way of moving the hand."""

    def start(self, target: Pose) -> None:
        """Begin to move the gripper to a pose in the base frame."""

    def end(self) -> ActionResult | None:
        """Return how the motion ended, once it has, and once only."""


@dataclass(frozen=True)
class TourConfig:
    """Patience of a tour.

    look_s: at a pose without a sample, before the next one. again_s: after a motion that was not done. most_refused:
    poses in a row to which there is no way. most_fruitless: poses in a row that gave no sample.
    """

    look_s: float = 6.0
    again_s: float = 5.0
    most_refused: int = 25
    most_fruitless: int = 15


class Tour:
    """Goes on once a sample was taken, or none can be; times [s] are handed in.

    Args:
        first: the pose to begin at; None: where the hand is.
        complain: told what hinders a motion.
    """

    def __init__(
        self,
        propose: Propose,
        mover: Mover,
        complain: Callable[[str], None],
        first: Pose | None = None,
        config: TourConfig | None = None,
    ) -> None:
        self._propose, self._mover, self._complain = propose, mover, complain
        self._config = config or TourConfig()
        self._first = first
        self._tried: list[Pose] = []
        self._is_moving = False
        self._until: float | None = None
        self._samples = self._fruitless = self._refused = 0

    def tick(self, now: float, samples: int) -> None:
        """Go on where that is due; to be called all the time. samples: taken so far.

        Raises:
            CalibrationError: when there is no way to so many poses, or so many gave no sample.
        """
        if self._is_moving:
            end = self._mover.end()
            if end is not None:
                self._is_moving = False
                self._judge(end, now)
        elif samples > self._samples:
            self._samples, self._fruitless = samples, 0
            self._go(now)
        elif self._until is None:
            self._begin(now)
        elif now > self._until:
            self._note_fruitless()
            self._go(now)

    def _begin(self, now: float) -> None:
        """Go to the first pose, or look from where the hand is."""
        self._until = now + self._config.look_s
        if self._first is not None:
            self._go_to(self._first)

    def _go(self, now: float) -> None:
        target = self._propose(self._tried)
        if target is not None:
            self._go_to(target)
            return
        self._fruitless -= 1
        self._until = now + self._config.again_s
        self._complain("where the gripper is is not known: does /tf join it to the base, and do transforms come?")

    def _go_to(self, target: Pose) -> None:
        self._tried.append(target)
        self._is_moving = True
        self._mover.start(target)

    def _note_fruitless(self) -> None:
        self._fruitless += 1
        if self._fruitless > self._config.most_fruitless:
            raise CalibrationError(
                f"no sample at {self._fruitless} poses in a row: bring the board into the picture by hand, or name a "
                "pose at which it is seen with --first"
            )

    def _judge(self, end: ActionResult, now: float) -> None:
        if end.outcome.is_success:
            self._until, self._refused = now + self._config.look_s, 0
            return
        target = self._tried[-1]
        self._fruitless -= 1  # nothing was looked for there
        if end.outcome is Outcome.PLANNING_FAILED or end.refusal is Refusal.OUT_OF_REACH:
            self._refused += 1
            self._until = now
            if self._refused > self._config.most_refused:
                raise CalibrationError(
                    f"{self._refused} poses in a row cannot be reached, the last one for: {end.message}; begin where "
                    "the arm has room, with --first or by hand"
                )
            return
        self._complain(f"the hand does not move to {describe_pose(target)}: {end.message}")
        self._until = now + self._config.again_s
