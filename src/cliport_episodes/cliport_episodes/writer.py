"""Recording of an episode, step by step; each step is on the disk once it was added."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from cliport_core.whole_file import UNFINISHED, sync
from cliport_episodes.bag_file import BagFile, describe, is_latched, write_bag_file
from cliport_episodes.bag_metadata import write_metadata
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set_file import read_setup
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.demonstration_messages import RECORD_TOPICS, messages_from_record
from cliport_episodes.disk import disk_errors, move
from cliport_episodes.edits import Edits
from cliport_episodes.episode_folder import (
    EPISODES,
    FINAL,
    TRASH,
    FolderLock,
    custom_data,
    edits_to_change,
    new_name,
    next_undone_path,
    read_own_setup,
    step_name,
    step_paths,
    undone_paths,
    unused_path,
    whole_files,
)
from cliport_episodes.errors import BagError, EpisodeError, SetupDiffersError
from cliport_episodes.names import check_instruction, check_name
from cliport_episodes.raw import RawMessage
from cliport_episodes.reader import read_record


class EpisodeWriter:
    """Writer of one episode, which it locks against other writers; not for several threads at once.

    Each step is a file of its own, complete on the disk when it gets its name; metadata.yaml lists it afterwards.
    Make one with `create` or `resume`; it ends with `finish`, `discard` or `close`.
    """

    def __init__(self, path: Path, setup: CaptureSetup, lock: FolderLock, edits: Edits) -> None:
        self.path, self.setup = path, setup
        self._lock, self._edits = lock, edits
        self._is_open = True
        self._steps: dict[int, BagFile] = {}
        self._final: BagFile | None = None

    @classmethod
    def create(cls, data_set: Path, setup: CaptureSetup, name: str | None = None) -> EpisodeWriter:
        """Make a new episode in a data set.

        Raises:
            DataSetError: when there is no data set.
            SetupDiffersError: when it was recorded with another setup.
            EpisodeError: when the data set has an episode of the given name.
            BadNameError, DiskError.
        """
        if differences := setup.differences(read_setup(data_set)):
            raise SetupDiffersError(data_set.name, differences)
        path = data_set / EPISODES / check_name("episode", name or new_name(datetime.now()))
        with disk_errors(path):
            try:
                path.mkdir(parents=True)
                sync(path.parent)
                sync(data_set)
            except FileExistsError:
                raise EpisodeError(f"episode '{path.name}' exists: choose another name") from None
            writer = cls(path, setup, FolderLock(path), Edits())
            try:
                writer._save(writer._edits)
            except OSError:
                writer.close()
                shutil.rmtree(path, ignore_errors=True)
                raise
        return writer

    @classmethod
    def resume(cls, episode: Path, setup: CaptureSetup | None = None) -> EpisodeWriter:
        """Open an episode that was interrupted or finished, to add steps after its last one.

        Raises:
            EpisodeError: when there is none, or its end was trimmed off; EpisodeBusyError when it is being written.
            SetupDiffersError: when it was recorded with another setup than the one given.
            DataSetError, DiskError.
        """
        lock = FolderLock(episode)
        try:
            own_setup = read_own_setup(episode) or read_setup(episode.parent.parent)
            if setup is not None and (differences := setup.differences(own_setup)):
                raise SetupDiffersError(episode.parent.parent.name, differences)
            with disk_errors(episode):
                edits = edits_to_change(episode)
            if edits.last is not None and max(step_paths(episode), default=-1) > edits.last:
                raise EpisodeError(f"episode '{episode.name}' was trimmed at its end: undo that, or begin a new one")
            edits = replace(edits, last=None)  # steps that are added must count
            writer = cls(episode, own_setup, lock, edits)
            writer._recover()
        except BaseException:
            lock.release()
            raise
        return writer

    @property
    def name(self) -> str:
        """Name of the episode in its data set."""
        return self.path.name

    @property
    def n_steps(self) -> int:
        """Number of steps on the disk."""
        return len(self._steps)

    def add_step(self, messages: Sequence[RawMessage], record: StepRecord) -> None:
        """Store one step: the messages of camera and arm before it, and its record. It is on the disk on return.

        The record's step number is set here. Latched messages are logged when the step begins, however old.

        Raises:
            DiskError, DiskFullError: when the disk refuses; earlier steps are whole, and this one may be tried again.
            InstructionError: when the instruction cannot be stored; BagError: when a message's type is unknown.
            EpisodeError: when the episode was ended.
        """
        instruction = check_instruction(record.instruction)
        self._reopen()
        number = max(step_paths(self.path), default=-1) + 1
        record = replace(record, step=number, instruction=instruction)
        seen = self._in_order(message for message in messages if message.topic not in RECORD_TOPICS)
        stamp_ns = seen[-1].stamp_ns if seen else max(self._end_ns, record.stamp_ns)
        path = self.path / step_name(number)
        with disk_errors(path):
            made = write_bag_file(path, [*seen, *messages_from_record(record, stamp_ns)])
            self._steps[number] = made
            try:
                self._save(self._edits)
            except OSError:
                del self._steps[number]
                path.unlink()
                raise

    def undo_step(self) -> None:
        """Move the last step to the data set's folder of undone steps, from which `restore_step` brings it back.

        Raises:
            EpisodeError: when there is no step, or the episode was ended. DiskError.
        """
        if not self._steps:
            raise EpisodeError(f"episode '{self.name}' has no step to undo")
        self._reopen()
        number = max(self._steps)
        undone = self._steps.pop(number)
        edits = replace(self._edits, instructions={k: v for k, v in self._edits.instructions.items() if k != number})
        before, target = self._edits, next_undone_path(self.path, number)
        with disk_errors(self.path):
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                sync(target.parent.parent)
                sync(target.parent.parent.parent)
                self._save(edits)
                move(self.path / undone.name, target)
            except OSError:
                self._steps[number] = undone
                with suppress(OSError):
                    self._save(before)
                raise

    def restorable(self) -> bool:
        """Return True if the step that was undone last can come back: none was added since."""
        return self._is_open and self._undone() is not None

    def restore_step(self) -> StepRecord:
        """Restore the step that was undone last; return its record.

        Raises:
            EpisodeError: when no step was undone, or another was added since.
            BagError: when its record cannot be read; it is not brought back then. DiskError.
        """
        self._check_open()
        found = self._undone()
        if found is None:
            raise EpisodeError(f"episode '{self.name}' has no step to bring back: none was undone since its last one")
        self._reopen()
        source, made = found
        number = max(self._steps, default=-1) + 1
        record = replace(read_record(source), step=number)
        path = self.path / step_name(number)
        with disk_errors(path):
            move(source, path)
            self._steps[number] = replace(made, name=path.name)
            try:
                self._save(self._edits)
            except OSError:
                del self._steps[number]
                move(path, source)
                raise
        return record

    def _undone(self) -> tuple[Path, BagFile] | None:
        """Return the undone step that would come next; None where it is older than the present last step."""
        paths = undone_paths(self.path, max(self._steps, default=-1) + 1)
        if not paths:
            return None
        path = paths[-1]
        try:
            made = describe(path)
        except BagError:
            return None
        return (path, made) if made.start_ns >= self._end_ns else None

    def finish(self, messages: Sequence[RawMessage], success: bool | None) -> None:
        """End the episode with the messages of camera and arm after its last step; there may be none.

        Raises:
            EpisodeError: when it has no step, or was ended before. DiskError: this can be tried again.
        """
        if not self._steps:
            raise EpisodeError(f"episode '{self.name}' has no step: discard it")
        self._reopen()
        with disk_errors(self.path):
            seen = self._in_order(message for message in messages if message.topic not in RECORD_TOPICS)
            if seen:
                self._final = write_bag_file(self.path / FINAL, seen)
            self._save(replace(self._edits, success=success, finished=True))
        self.close()

    def discard(self) -> None:
        """End the episode and move it to the data set's trash; one without steps is removed. Raises DiskError."""
        self._check_open()
        trash = self.path.parent.parent / TRASH
        with disk_errors(self.path):
            if step_paths(self.path):  # also such as cannot be read just now
                trash.mkdir(exist_ok=True)
                move(self.path, unused_path(trash, self.name))
            else:
                shutil.rmtree(self.path)
        self.close()

    def close(self) -> None:
        """Leave the episode as it is, to be resumed; may be called twice."""
        self._is_open = False
        self._lock.release()

    @property
    def _end_ns(self) -> int:
        return max((file.end_ns for file in self._steps.values()), default=0)

    def _in_order(self, messages: Iterable[RawMessage]) -> list[RawMessage]:
        """Return messages in the order of their times, which are moved to the last step's end where they precede it."""
        unordered = list(messages)
        live = [message.stamp_ns for message in unordered if not is_latched(message.topic)]
        begin = max(self._end_ns, min(live, default=0))
        stamped = [
            replace(message, stamp_ns=begin if is_latched(message.topic) else max(begin, message.stamp_ns))
            for message in unordered
        ]
        return sorted(stamped, key=lambda message: message.stamp_ns)

    def _recover(self) -> None:
        """Find the steps on the disk, and remove the files of an interrupted writer."""
        self._steps, final = whole_files(self.path)
        self._final = final if self._edits.finished else None
        with disk_errors(self.path):
            if not self._edits.finished:
                (self.path / FINAL).unlink(missing_ok=True)
            for left in self.path.glob(f".*{UNFINISHED}"):
                left.unlink()
            self._save(self._edits)

    def _reopen(self) -> None:
        """Remove the final scene of a finished episode, which would be wrong after another step."""
        self._check_open()
        if self._edits.finished:
            self._final = None
            with disk_errors(self.path):
                self._save(replace(self._edits, finished=False))
                (self.path / FINAL).unlink(missing_ok=True)

    def _save(self, edits: Edits) -> None:
        files = list(self._steps.values())
        if self._final is not None:
            files.append(self._final)
        write_metadata(self.path, files, custom_data(edits, self.setup))
        self._edits = edits

    def _check_open(self) -> None:
        if not self._is_open:
            raise EpisodeError(f"episode '{self.name}' was ended: resume it, or begin another")
