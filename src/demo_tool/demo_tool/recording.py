"""The data set that is open, and the episode that is being recorded in it."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.episode_folder import EPISODES
from cliport_episodes.errors import EpisodeError, SetupDiffersError
from cliport_episodes.names import check_name
from cliport_episodes.raw import RawMessage
from cliport_episodes.writer import EpisodeWriter
from demo_tool.errors import NotNowError, StationError
from demo_tool.wording import outcome_words

_HISTORY = 20  # recent instructions that are kept


class Recorder:
    """Safe between threads. What it shows is replaced as a whole, so that reading it never waits for a disk.

    Raises everywhere:
        EpisodesError: when the disk or the data refuse.
    """

    def __init__(self, root: Path, min_free: int) -> None:
        """root: of all data sets, made where it is not there; StationError when that cannot be."""
        self._root, self._min_free = root, min_free
        self._lock = threading.RLock()
        self._writer: EpisodeWriter | None = None
        self._steps: tuple[dict[str, Any], ...] = ()
        self.data_set: DataSet | None = None
        self.data_set_name: str | None = None
        self.data_set_names: tuple[str, ...] = ()
        self.episode: dict[str, Any] | None = None
        self.last_episode: str | None = None
        self.history: tuple[str, ...] = ()
        try:
            root.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StationError(f"data sets cannot be kept in {root}: {error.strerror}") from None
        self.list_data_sets()

    def open(self, name: str, setup: CaptureSetup | None) -> str:
        """Open a data set, new where there is none; an episode that a crash left unfinished goes on. Words.

        setup: as it is now, None when not known yet: then it is compared before the next step.

        Raises:
            StationError: when a new one is asked for and nothing is known of the camera.
            SetupDiffersError: says in words what differs.
        """
        path = self._root / check_name("data set", name)
        with self._lock:
            if setup is not None:
                data_set = DataSet.open_or_create(path, setup)
            elif path.exists():
                data_set = DataSet.open(path)
            else:
                raise NotNowError(f"data set '{name}' is new: it can be begun once the camera sends pictures")
            self._forget_episode()
            self.data_set, self.data_set_name = data_set, name
            self.list_data_sets()
            return self._continue_episode(data_set)

    def check(self, setup: CaptureSetup) -> None:
        """Whether a step can be recorded now.

        Raises:
            NotNowError, StationError, SetupDiffersError: why not.
        """
        if self.data_set is None or self.data_set_name is None:
            raise NotNowError("open a data set first, so that the step has a place")
        differences = self.data_set.setup.differences(setup)
        if differences:
            raise SetupDiffersError(self.data_set_name, differences)
        free = shutil.disk_usage(self._root).free
        if free < self._min_free:
            raise StationError(
                f"the disk is full: {free / 1e6:.0f} MB are free, {self._min_free / 1e6:.0f} MB are needed for a step; "
                "empty the trash or make room"
            )

    def begin_episode(self, setup: CaptureSetup) -> None:
        """Make sure that an episode is open."""
        with self._lock:
            if self._writer is None and self.data_set_name is not None:
                self._writer = EpisodeWriter.create(self._root / self.data_set_name, setup)
                self._steps = ()
                self._show()

    def add_step(self, messages: Sequence[RawMessage], record_of: Callable[[int], StepRecord]) -> None:
        """Record a step; record_of is given its number. Durable when this returns."""
        with self._lock:
            writer = self._open_writer("record")
            record = record_of(writer.n_steps)
            writer.add_step(messages, record)
            self._steps = (*self._steps, step_shown(record))
            self.remember(record.instruction)
            self._show()

    def undo_step(self) -> None:
        """Drop the last step. Raises NotNowError when there is none."""
        with self._lock:
            writer = self._open_writer("undo")
            if writer.n_steps == 0:
                raise NotNowError("the episode has no step to undo")
            writer.undo_step()
            self._steps = self._steps[:-1]
            self._show()

    def refuse_to_end(self) -> None:
        """Raises NotNowError when there is no episode, or none of its steps."""
        with self._lock:
            self._writer_of_steps()

    def finish(self, messages: Sequence[RawMessage], success: bool | None) -> str:
        """End the episode with the finished scene, or none where there is no picture; its name."""
        with self._lock:
            writer = self._writer_of_steps()
            writer.finish(messages, success)
            self.last_episode = str(writer.name)
            self._forget_episode()
            return self.last_episode

    def discard(self) -> str:
        """Throw the episode away; its name."""
        with self._lock:
            writer = self._open_writer("discard")
            writer.discard()
            self._forget_episode()
            return str(writer.name)

    def remember(self, instruction: str) -> None:
        """Put an instruction at the head of the history."""
        others = [text for text in self.history if text != instruction]
        self.history = (instruction, *others)[:_HISTORY]

    def close(self) -> None:
        """Leave the episode as it is; it goes on when its data set is opened again."""
        with self._lock:
            self._forget_episode()

    def _writer_of_steps(self) -> EpisodeWriter:
        writer = self._open_writer("end")
        if writer.n_steps == 0:
            raise NotNowError("the episode has no steps: record one, or discard it")
        return writer

    def _open_writer(self, what: str) -> EpisodeWriter:
        if self._writer is None:
            raise NotNowError(f"there is nothing to {what}: no episode has been begun")
        return self._writer

    def _continue_episode(self, data_set: DataSet) -> str:
        """Find what a crash left, and the instructions of what is there."""
        infos = data_set.episodes()
        for info in infos:
            for text in info.instructions:
                self.remember(text)
        opened = f"data set '{self.data_set_name}' is open: {len(infos)} episodes"
        unfinished = [info for info in infos if not info.finished]
        if not unfinished:
            return opened
        last = unfinished[-1]
        try:
            self._writer = EpisodeWriter.resume(data_set.path / EPISODES / last.name)
        except EpisodeError as error:
            return f"{opened}; episode {last.name} cannot go on: {error}"
        self._steps = tuple(step_shown(record) for record in last.records)
        self._show()
        return f"{opened}; episode {last.name} goes on after {len(self._steps)} steps"

    def _forget_episode(self) -> None:
        if self._writer is not None:
            self._writer.close()
        self._writer, self._steps, self.episode = None, (), None

    def _show(self) -> None:
        if self._writer is not None:
            self.episode = {"name": str(self._writer.name), "steps": list(self._steps)}

    def list_data_sets(self) -> None:
        """Look which there are; a hidden one was not made to its end."""
        names = sorted(path.parent.name for path in self._root.glob("*/dataset.yaml"))
        self.data_set_names = tuple(name for name in names if not name.startswith("."))


def step_shown(record: StepRecord) -> dict[str, Any]:
    """For the page."""
    return {
        "step": record.step,
        "instruction": record.instruction,
        "primitive": record.primitive.name.lower(),
        "source": record.source.name.lower(),
        "outcome": outcome_words(record.outcome, record.executed),
        "message": record.message,
    }
