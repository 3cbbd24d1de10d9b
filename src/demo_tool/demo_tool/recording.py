"""Recorder of episodes: the open data set, and the episode that is being recorded in it."""

from __future__ import annotations

import logging
import shutil
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import NOT_MOVED, PixelBox, StepRecord
from cliport_episodes.episode_folder import EPISODES
from cliport_episodes.errors import DiskError, EpisodeError, SetupDiffersError
from cliport_episodes.motion_video import MotionVideo, video_path, write_video
from cliport_episodes.names import check_name
from cliport_episodes.raw import RawMessage
from cliport_episodes.summary import EpisodeInfo
from cliport_episodes.writer import EpisodeWriter
from demo_tool.errors import NotNowError, StationError
from demo_tool.wording import outcome_words

_LOG = logging.getLogger(__name__)
_HISTORY = 20  # recent instructions that are kept
_COVERED = 500  # latest steps whose places are shown


class Recorder:
    """Open data set and present episode, safe between threads.

    Its public attributes are replaced as a whole, so that reading them never waits for a disk.

    Raises everywhere:
        EpisodesError: when the disk refuses, or the data set does.
    """

    def __init__(self, root: Path, min_free: int) -> None:
        """Make the folder `root` of all data sets where it is missing. Raises StationError when that fails."""
        self._root, self._min_free = root, min_free
        self._lock = threading.RLock()
        self._writer: EpisodeWriter | None = None
        self._steps: tuple[dict[str, Any], ...] = ()
        self.data_set: DataSet | None = None
        self.data_set_name: str | None = None
        self.data_set_names: tuple[str, ...] = ()
        self.recorded = 0
        self.covered: dict[str, list[list[int]]] = {"pick": [], "place": []}
        self.episode: dict[str, Any] | None = None
        self.last_episode: str | None = None
        self.history: tuple[str, ...] = ()
        try:
            root.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StationError(f"data sets cannot be kept in {root}: {error.strerror}") from None
        self.list_data_sets()

    def open(self, name: str, setup: CaptureSetup | None) -> str:
        """Open a data set, or make it, and resume its unfinished episode; return a sentence for the page.

        setup: the present one; None when not known yet, then it is compared before the next step. What was open before
        stays open where an error is raised.

        Raises:
            NotNowError: when the data set is new and nothing is known of the camera.
            SetupDiffersError: when the data set was recorded with another setup.
        """
        path = self._root / check_name("data set", name)
        with self._lock:
            if setup is not None:
                data_set = DataSet.open_or_create(path, setup)
            elif path.exists():
                data_set = DataSet.open(path)
            else:
                raise NotNowError(f"data set '{name}' is new: it can be begun once the camera sends pictures")
            infos = data_set.episodes()
            writer, steps, words = self._resume_episode(data_set, name, infos)
            if writer is not self._writer:
                self._forget_episode()
            self.data_set, self.data_set_name = data_set, name
            self._look_over(infos)
            self._writer, self._steps = writer, steps
            self._update_episode()
            for text in (text for info in infos for text in info.instructions):
                self.remember(text)
            self.list_data_sets()
            return words

    def check(self, setup: CaptureSetup) -> None:
        """Check that a step can be recorded now.

        Raises:
            NotNowError: when no data set is open.
            SetupDiffersError: when it was recorded with another setup.
            StationError: when the disk is full.
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
        """Make a new episode unless one is being recorded."""
        with self._lock:
            if self._writer is None and self.data_set_name is not None:
                self._writer = EpisodeWriter.create(self._root / self.data_set_name, setup)
                self._update_episode()

    def add_step(self, messages: Sequence[RawMessage], record_of: Callable[[int], StepRecord]) -> None:
        """Record a step, whose record `record_of` makes of its number. It is on the disk on return."""
        with self._lock:
            writer = self._open_writer("record")
            record = record_of(writer.n_steps)
            writer.add_step(messages, record)
            self._steps = (*self._steps, step_shown(record))
            self.remember(record.instruction)
            self._update_episode()

    def add_video(self, stamp_ns: int, video: MotionVideo) -> None:
        """Store the video of the motion of the step that was chosen on the picture of stamp_ns; it may be missing."""
        with self._lock:
            if self._writer is None:
                return
            try:
                write_video(video_path(self._writer.path, stamp_ns), video)
            except DiskError as error:
                _LOG.warning("the motion's video is not kept: %s", error)

    def undo_step(self) -> None:
        """Undo the last step. Raises NotNowError when there is none."""
        with self._lock:
            writer = self._open_writer("undo")
            if writer.n_steps == 0:
                raise NotNowError("the episode has no step to undo")
            writer.undo_step()
            self._steps = self._steps[:-1]
            self._update_episode()

    def restore_step(self) -> None:
        """Bring back the step that was undone last. Raises NotNowError when no episode is open."""
        with self._lock:
            writer = self._open_writer("bring back")
            record = writer.restore_step()
            self._steps = (*self._steps, step_shown(record))
            self._update_episode()

    def refuse_to_end(self) -> None:
        """Raise NotNowError when there is no episode, or it has no step."""
        with self._lock:
            self._writer_with_steps()

    def finish(self, messages: Sequence[RawMessage], success: bool | None) -> str:
        """End the episode with the messages of the finished scene, if there are any; return its name."""
        with self._lock:
            writer = self._writer_with_steps()
            writer.finish(messages, success)
            self.last_episode = str(writer.name)
            self._forget_episode()
            self.look_over()
            return self.last_episode

    def discard(self) -> str:
        """Discard the episode; return its name."""
        with self._lock:
            writer = self._open_writer("discard")
            writer.discard()
            self._forget_episode()
            return str(writer.name)

    def continue_episode(self, name: str) -> str:
        """Open another episode of the data set to add steps to it, finished or not; return a sentence for the page.

        The present one is left unfinished.

        Raises:
            NotNowError: when no data set is open.
            EpisodeError: when there is none of that name, or it cannot go on. What was open before stays open then.
        """
        with self._lock:
            if self.data_set is None:
                raise NotNowError("open a data set first")
            if self._writer is not None and self._writer.name == name:
                return f"episode {name} is open already"
            records = self.data_set.episode(name).steps
            writer = EpisodeWriter.resume(self.data_set.path / EPISODES / name)
            self._forget_episode()
            self._writer, self._steps = writer, tuple(step_shown(step.record) for step in records)
            self._update_episode()
            return f"episode {name} goes on after {len(records)} steps"

    def remember(self, instruction: str) -> None:
        """Put an instruction at the head of the history."""
        others = [text for text in self.history if text != instruction]
        self.history = (instruction, *others)[:_HISTORY]

    def close(self) -> None:
        """Leave the episode unfinished; it is resumed when its data set is opened again."""
        with self._lock:
            self._forget_episode()

    def _look_over(self, infos: Sequence[EpisodeInfo]) -> None:
        finished = [info for info in infos if info.finished]
        self.recorded = len(finished)
        records = [record for info in finished for record in info.records][-_COVERED:]
        self.covered = {
            "pick": [_middle(record.pick_box) for record in records if record.pick_box is not None],
            "place": [_middle(record.place_box) for record in records if record.place_box is not None],
        }

    def _writer_with_steps(self) -> EpisodeWriter:
        writer = self._open_writer("end")
        if writer.n_steps == 0:
            raise NotNowError("the episode has no steps: record one, or discard it")
        return writer

    def _open_writer(self, what: str) -> EpisodeWriter:
        if self._writer is None:
            raise NotNowError(f"there is nothing to {what}: no episode has been begun")
        return self._writer

    def _resume_episode(
        self, data_set: DataSet, name: str, infos: Sequence[EpisodeInfo]
    ) -> tuple[EpisodeWriter | None, tuple[dict[str, Any], ...], str]:
        """Return the writer of a data set's unfinished episode, its steps as shown, and a sentence for the page."""
        opened = f"data set '{name}' is open: {len(infos)} episodes"
        unfinished = [info for info in infos if not info.finished]
        if not unfinished:
            return None, (), opened
        last = unfinished[-1]
        steps = tuple(step_shown(record) for record in last.records)
        going_on = f"{opened}; episode {last.name} goes on after {len(steps)} steps"
        path = data_set.path / EPISODES / last.name
        if self._writer is not None and self._writer.path == path:
            return self._writer, steps, going_on
        try:
            return EpisodeWriter.resume(path), steps, going_on
        except EpisodeError as error:
            return None, (), f"{opened}; episode {last.name} cannot go on: {error}"

    def _forget_episode(self) -> None:
        if self._writer is not None:
            self._writer.close()
        self._writer, self._steps, self.episode = None, (), None

    def _update_episode(self) -> None:
        if self._writer is not None:
            restorable = self._writer.restorable()
            self.episode = {"name": str(self._writer.name), "steps": list(self._steps), "restorable": restorable}

    def look_over(self) -> None:
        """Update what is said of the data set's finished episodes: how many there are, and where their steps were."""
        with self._lock:
            if self.data_set is not None:
                self._look_over(self.data_set.episodes())

    def list_data_sets(self) -> None:
        """Update the names of the data sets, without hidden ones, which are incomplete."""
        found = {path.parent.name for part in ("dataset.yaml", EPISODES) for path in self._root.glob(f"*/{part}")}
        self.data_set_names = tuple(name for name in sorted(found) if not name.startswith("."))


def _middle(box: PixelBox) -> list[int]:
    """Return row and column of a box's middle."""
    return [(box.top + box.bottom) // 2, (box.left + box.right) // 2]


def step_shown(record: StepRecord) -> dict[str, Any]:
    """Return a step as the page shows it."""
    return {
        "step": record.step,
        "instruction": record.instruction,
        "primitive": record.action.primitive.label,
        "source": record.source.name.lower(),
        "outcome": outcome_words(record.result.outcome) if record.result else NOT_MOVED,
        "message": record.result.message if record.result else "",
    }
