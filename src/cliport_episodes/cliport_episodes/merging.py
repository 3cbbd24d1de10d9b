"""Merging of episodes: a copy that went on elsewhere, or was edited since, is the same episode and no second one."""

from __future__ import annotations

import filecmp
from enum import Enum, auto
from pathlib import Path
from typing import NamedTuple

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.disk import copy_folder, disk_errors, move
from cliport_episodes.episode_folder import change_edits, locked, read_edits, step_paths, unused_path


class Kinship(Enum):
    """Relation of an episode that is offered to one that is here, by the steps that they begin with."""

    STRANGER = auto()
    SAME = auto()
    SHORTER = auto()  # it lacks steps that were added here
    LONGER = auto()  # steps were added to it there
    FORKED = auto()  # other steps were added here and there


class Merged(NamedTuple):
    """Result of a merge by names that the episodes have here; n_offered: number of the other's episodes.

    added: new ones; updated: went on there, or were edited there later than here; forked: went on in both, and stay as
    they are here.
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
            words += f"; {len(self.forked)} went on in both and stay as they are here: {', '.join(self.forked)}"
        known = len(self.added) + len(self.updated) + len(self.forked)
        return words if known == self.n_offered else f"{words}; the others were here already"


def kinship(offered: Path, here: Path) -> Kinship:
    """Return how an episode's folder is related to another one."""
    theirs, mine = step_paths(offered), step_paths(here)
    shared = 0
    for (their_number, their_file), (number, file) in zip(theirs.items(), mine.items(), strict=False):
        if their_number != number or not filecmp.cmp(their_file, file, shallow=False):
            break
        shared += 1
    if shared == len(theirs):
        return Kinship.SAME if shared == len(mine) else Kinship.SHORTER
    if shared == len(mine):
        return Kinship.LONGER
    return Kinship.FORKED if shared else Kinship.STRANGER


def take_over_steps(offered: Path, here: Path, trash: Path) -> None:
    """Put a copy of an episode in the place of one here, which goes to the trash.

    Raises:
        EpisodeBusyError, DiskError.
    """
    with locked(offered), locked(here), disk_errors(here):
        trash.mkdir(exist_ok=True)
        kept = unused_path(trash, here.name)
        move(here, kept)
        try:
            copy_folder(offered, here)
        except OSError:
            move(kept, here)
            raise


def take_over_edits(offered: Path, here: Path, setup: CaptureSetup) -> bool:
    """Give an episode the edits of its copy where those are later; return True if it did.

    Raises:
        EpisodeBusyError, DiskError.
        EpisodeError: when the edits here cannot be read.
    """
    (theirs, complaint), (mine, _) = read_edits(offered), read_edits(here)
    if complaint is not None or theirs.edited_ns <= mine.edited_ns:
        return False
    change_edits(here, lambda _: theirs, setup, theirs.edited_ns)
    return True
