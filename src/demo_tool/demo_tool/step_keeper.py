"""Keeper of the step that moved the arm, until it is on the disk."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from cliport_core.outcome import ActionResult
from cliport_episodes.errors import EpisodesError
from cliport_episodes.motion_video import MotionVideo
from demo_tool.draft_desk import DrawnAction
from demo_tool.errors import EXPECTED_ERRORS, NotNowError
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig
from demo_tool.steps import record_of


@dataclass(frozen=True)
class MovedStep:
    """A step that moved the arm; words: its result as a phrase; video: of its motion, where there is one."""

    drawn: DrawnAction
    instruction: str
    result: ActionResult
    words: str
    video: MotionVideo | None = None


class StepKeeper:
    """Keeper of a step that moved the arm and could not be recorded, to be saved again or dropped."""

    def __init__(self, recorder: Recorder, config: StationConfig) -> None:
        self._recorder, self._config = recorder, config
        self.unsaved: MovedStep | None = None

    def save(self, step: MovedStep) -> None:
        """Record a step, and keep it where that fails. Raises EpisodesError, StationError, OSError."""
        try:
            self._recorder.add_step(
                step.drawn.view.to_record(),
                lambda number: record_of(number, step.drawn, step.instruction, step.result, self._config),
            )
        except BaseException:
            self.unsaved = step
            raise
        self.unsaved = None
        if step.video is not None:
            self._recorder.add_video(step.drawn.view.stamp_ns, step.video)

    def saved_or_why_not(self, step: MovedStep) -> str:
        """Record a step, whatever fails; return "", or a sentence for the page."""
        try:
            self.save(step)
        except EXPECTED_ERRORS as error:
            return f"the arm moved ({step.words}), but the step was not recorded: {error}"
        except Exception as error:  # a defect must not leave the station recording for ever
            return f"the step was not recorded: internal error: {type(error).__name__}: {error}"
        return ""

    def save_again(self) -> MovedStep:
        """Record the kept step. Raises NotNowError when there is none; EpisodesError, StationError, OSError."""
        step = self._kept()
        self.save(step)
        return step

    def drop(self) -> MovedStep:
        """Drop the kept step. Raises NotNowError when there is none."""
        step = self._kept()
        self.unsaved = None
        return step

    def refuse_when_unsaved(self) -> None:
        """Raise NotNowError while a step is kept: later steps must not be recorded before it."""
        if self.unsaved is not None:
            raise NotNowError("the last step moved the arm and is not saved: save it again, or drop it")

    def close(self) -> None:
        """Try a last time to record the kept step."""
        if self.unsaved is not None:
            with suppress(EpisodesError, NotNowError, OSError):
                self.save_again()

    def _kept(self) -> MovedStep:
        if self.unsaved is None:
            raise NotNowError("every step is saved")
        return self.unsaved
