"""Merging of episodes: a copy that went on elsewhere, or was edited since, is the same episode and no second one."""

from __future__ import annotations

import filecmp
from collections.abc import Mapping
from enum import Enum, auto
from pathlib import Path
from typing import NamedTuple

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.disk import copy_folder, disk_errors, move
from cliport_episodes.episode_folder import change_edits, locked, read_edits, step_paths, unused_path


class Fate(Enum):
    """Outcome of a merge for one episode."""

    ADDED = auto()
    KNOWN = auto()  # all of it was here
    UPDATED = auto()  # it went on there, or was edited there later
    FORKED = auto()  # it went on or was edited in both, and stays as it is here


class Merged(NamedTuple):
    """Result of a merge by names that the episodes have here; n_offered: number of the other's episodes.

    added, updated, forked: those of that `Fate`.
    """

    added: tuple[str, ...]
    updated: tuple[str, ...]
    forked: tuple[str, ...]
    n_offered: int

    def words(self, other: str) -> str:
        """Return the result as a phrase; other: name of the data set that was merged."""
        words = f"{len(self.added)} of the {self.n_offered} episodes of {other} are added"
        if self.updated:
            words += f"; {len(self.updated)} went on or were edited there and are taken over: {', '.join(self.updated)}"
        if self.forked:
            forked = ", ".join(self.forked)
            words += f"; {len(self.forked)} went on or were edited in both and stay as they are here: {forked}"
        known = len(self.added) + len(self.updated) + len(self.forked)
        return words if known == self.n_offered else f"{words}; the others were here already"


def merge_known(offered: Path, here: Path, setup: CaptureSetup, trash: Path) -> Fate | None:
    """Take over what is new in a copy of an episode here; return what became of it, None where it is no copy.

    Raises:
        EpisodeBusyError, DiskError.
        EpisodeError: when the edits here cannot be written over.
    """
    theirs, mine = step_paths(offered), step_paths(here)
    shared = _shared_steps(theirs, mine)
    edited = _edited_ns(offered) - _edited_ns(here)  # more than 0: later there
    if shared == len(theirs) == len(mine):
        return Fate.UPDATED if edited > 0 and _take_over_edits(offered, here, setup) else Fate.KNOWN
    if shared == len(theirs):
        return Fate.FORKED if edited > 0 else Fate.KNOWN
    if shared == len(mine):
        if edited < 0:
            return Fate.FORKED
        _take_over_steps(offered, here, trash)
        return Fate.UPDATED
    return Fate.FORKED if shared else None


def _shared_steps(theirs: Mapping[int, Path], mine: Mapping[int, Path]) -> int:
    """Return with how many equal steps two episodes begin."""
    shared = 0
    for (their_number, their_file), (number, file) in zip(theirs.items(), mine.items(), strict=False):
        if their_number != number or not filecmp.cmp(their_file, file, shallow=False):
            break
        shared += 1
    return shared


def _edited_ns(folder: Path) -> int:
    """Return when an episode was edited last, since the epoch; 0 where that is not known."""
    return read_edits(folder)[0].edited_ns


def _take_over_steps(offered: Path, here: Path, trash: Path) -> None:
    """Put a copy of an episode in the place of one here, which goes to the trash."""
    with locked(offered), locked(here), disk_errors(here):
        trash.mkdir(exist_ok=True)
        kept = unused_path(trash, here.name)
        move(here, kept)
        try:
            copy_folder(offered, here)
        except OSError:
            move(kept, here)
            raise


def _take_over_edits(offered: Path, here: Path, setup: CaptureSetup) -> bool:
    """Give an episode the edits of its copy; return False where those cannot be read."""
    theirs, complaint = read_edits(offered)
    if complaint is not None:
        return False
    change_edits(here, lambda _: theirs, setup, theirs.edited_ns)
    return True
