"""A folder of episodes that share one setup: listing and editing them."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cliport_core.whole_file import UNFINISHED
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set_file import FILE, read_setup, restore_setup, write_setup
from cliport_episodes.disk import copy_folder, disk_errors, move
from cliport_episodes.edits import Edits
from cliport_episodes.episode_folder import (
    EPISODES,
    TRASH,
    UNDONE,
    change_edits,
    locked,
    step_paths,
    unused_path,
)
from cliport_episodes.errors import DataSetError, EpisodeError, SetupDiffersError
from cliport_episodes.merging import Fate, Merged, merge_known
from cliport_episodes.names import check_instruction, check_name
from cliport_episodes.reader import Episode, read_episode
from cliport_episodes.statistics import Statistics, count_statistics
from cliport_episodes.statistics_picture import draw_statistics
from cliport_episodes.summary import EpisodeIndex, EpisodeInfo

__all__ = ["DataSet", "draw_statistics"]


class DataSet:
    """A data set on the disk. Edits are kept in the episodes' metadata.yaml; raw files are never changed.

    Every method that takes an episode's name raises BadNameError, or EpisodeError where there is none; those that
    change something raise EpisodeBusyError while it is being recorded, and DiskError.
    """

    def __init__(self, path: Path, setup: CaptureSetup) -> None:
        """Prefer `create`, `open` or `open_or_create`."""
        self.path, self.setup = path, setup
        self._index = EpisodeIndex(path / "index.json")

    @classmethod
    def create(cls, path: Path, setup: CaptureSetup) -> DataSet:
        """Make a new data set. Raises DataSetError when the folder holds something; BadNameError, DiskError."""
        check_name("data set", path.name)
        if path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise DataSetError(f"'{path}' exists and is not an empty folder: choose another name")
        write_setup(path, setup)
        return cls(path, setup)

    @classmethod
    def open(cls, path: Path) -> DataSet:
        """Open an existing data set; where dataset.yaml was lost, it is made again from what the episodes carry.

        Raises:
            DataSetError: when there is none, or its episodes do not agree in their setup. DiskError.
        """
        if not (path / FILE).exists():
            restore_setup(path)
        return cls(path, read_setup(path))

    @classmethod
    def open_or_create(cls, path: Path, setup: CaptureSetup) -> DataSet:
        """Open a data set, or create it where there is none.

        Raises:
            SetupDiffersError: when it was recorded with another camera, calibration or workspace.
            DataSetError, BadNameError, DiskError.
        """
        if not (path / FILE).exists() and not (path / EPISODES).is_dir():
            return cls.create(path, setup)
        found = cls.open(path)
        if differences := setup.differences(found.setup):
            raise SetupDiffersError(path.name, differences)
        return found

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.path.resolve().name

    def episodes(self) -> list[EpisodeInfo]:
        """Return all episodes, the oldest first."""
        return self._index.refresh(self._folders(EPISODES))

    def rebuild_index(self) -> list[EpisodeInfo]:
        """Make the index anew from the bags; return all episodes, the oldest first."""
        with disk_errors(self.path):
            self._index.forget()
        return self.episodes()

    def episode(self, name: str) -> Episode:
        """Read an episode."""
        return read_episode(self._folder(name))

    def relabel(self, name: str, text: str, step: int | None = None) -> None:
        """Give one step, or all, another instruction. Raises InstructionError."""
        instruction = check_instruction(text)
        numbers = step_paths(self._folder(name))
        if step is not None and step not in numbers:
            raise EpisodeError(f"episode '{name}' has no step {step}: it has {_span(numbers)}")
        labels = {number: instruction for number in numbers if step in (None, number)}
        self._edit(name, lambda edits: replace(edits, instructions={**edits.instructions, **labels}))

    def mark(self, name: str, success: bool | None) -> None:
        """Record whether an episode shows what its instructions ask for; None: not judged."""
        self._edit(name, lambda edits: replace(edits, success=success))

    def trim(self, name: str, first: int | None, last: int | None) -> None:
        """Keep only the steps first..last, by their numbers as recorded; None: from the beginning, to the end.

        A bound that cuts nothing off is not kept, so that the episode can go on after its last step.
        """
        numbers = step_paths(self._folder(name))
        if not any(Edits(first=first, last=last).keeps(number) for number in numbers):
            raise EpisodeError(f"trimming episode '{name}' so would leave no step: it has {_span(numbers)}")
        if first is not None and first < 0:
            raise EpisodeError(f"episode '{name}' has no step {first}: it has {_span(numbers)}")
        first = first if first is not None and first > min(numbers) else None
        last = last if last is not None and last < max(numbers) else None
        self._edit(name, lambda edits: replace(edits, first=first, last=last))

    def delete(self, name: str) -> None:
        """Put an episode into the trash."""
        folder = self._folder(name)
        with locked(folder), disk_errors(folder):
            (self.path / TRASH).mkdir(exist_ok=True)
            move(folder, unused_path(self.path / TRASH, name))

    def trashed(self) -> list[str]:
        """Return the names of the episodes in the trash."""
        return [folder.name for folder in self._folders(TRASH)]

    def restore(self, name: str) -> None:
        """Take an episode out of the trash. Raises EpisodeError when the data set has one of that name."""
        folder = self.path / TRASH / check_name("episode", name)
        target = self.path / EPISODES / name
        if not folder.is_dir():
            raise EpisodeError(f"there is no episode '{name}' in the trash of '{self.name}'")
        if target.exists():
            raise EpisodeError(f"data set '{self.name}' has another episode '{name}': delete that first")
        with disk_errors(target):
            target.parent.mkdir(exist_ok=True)
            move(folder, target)

    def empty_trash(self) -> int:
        """Remove trashed episodes and undone steps for good; return the number of episodes. Raises DiskError."""
        folders = self._folders(TRASH)
        with disk_errors(self.path / TRASH):
            for folder in [*folders, *self._folders(UNDONE)]:
                shutil.rmtree(folder)
        return len(folders)

    def undone_steps(self) -> int:
        """Return the number of undone steps, which are kept until the trash is emptied."""
        return sum(1 for folder in self._folders(UNDONE) for _ in folder.iterdir())

    def statistics(self) -> Statistics:
        """Return counts over the steps."""
        return count_statistics(self.episodes(), self.setup.workspace)

    def merge(self, other: Path) -> Merged:
        """Add the episodes of another data set, which is left unchanged.

        An episode that is here already, step by step, is not added again. Where it went on there, it takes the place of
        the one here, which goes to the trash; where it was edited there later, its edits are taken over. Where both
        went on or were edited otherwise, that here stays. One that shares only its name gets another name.

        Raises:
            SetupDiffersError: when the other was recorded with another setup.
            DataSetError: when the folder is no data set, or this one; EpisodeBusyError, DiskError.
        """
        source = DataSet.open(other)
        if source.path.resolve() == self.path.resolve():
            raise DataSetError(f"data set '{self.name}' cannot be merged with itself: name another")
        if differences := source.setup.differences(self.setup):
            raise SetupDiffersError(self.name, differences)
        offered = source._folders(EPISODES)
        found = [self._merge_one(folder) for folder in offered]
        added, updated, forked = (
            tuple(name for fate, name in found if fate is wanted) for wanted in (Fate.ADDED, Fate.UPDATED, Fate.FORKED)
        )
        return Merged(added, updated, forked, len(offered))

    def _merge_one(self, folder: Path) -> tuple[Fate, str]:
        """Take in an episode from elsewhere; return what became of it, and its name here."""
        # an episode that was merged before has its own name here, or that with a number
        for here in self._folders(EPISODES):
            if f"{here.name}-".startswith(f"{folder.name}-"):
                fate = merge_known(folder, here, self.setup, self.path / TRASH)
                if fate is not None:
                    return fate, here.name
        return Fate.ADDED, self._add(folder)

    def split(self, shares: Sequence[tuple[str, float]], seed: int) -> dict[str, DataSet]:
        """Split the episodes at random into new data sets `<this>_<part>` beside this one, which is left unchanged.

        shares: each part's name, and its share (at most 1 in all) or its number of episodes; seed: for the random
        order. Returns the new data sets by their parts.

        Raises:
            DataSetError: when two parts have one name, there are too few episodes, or one of the data sets exists.
            BadNameError, DiskError.
        """
        if seed < 0:
            raise DataSetError(f"the seed of a split is {seed}: give 0 or more")
        parts = _by_name(shares)
        folders = [self._folder(info.name) for info in self.episodes() if info.n_steps]
        counts = _counts(parts, len(folders))
        folder_of = self.path.resolve().parent
        targets = {part: folder_of / check_name("data set", f"{self.name}_{part}") for part in parts}
        for target in targets.values():
            if target.exists():
                raise DataSetError(f"'{target.name}' exists: move it away, or name the parts otherwise")
        order = iter(np.random.default_rng(seed).permutation(len(folders)))
        for part, target in targets.items():
            self._write_part([folders[next(order)] for _ in range(counts[part])], target)
        return {part: DataSet.open(target) for part, target in targets.items()}

    def _write_part(self, folders: list[Path], target: Path) -> None:
        new = target.with_name(f".{target.name}{UNFINISHED}")
        shutil.rmtree(new, ignore_errors=True)
        try:
            write_setup(new, self.setup)
            made = DataSet(new, self.setup)
            for folder in sorted(folders):
                made._add(folder)
            with disk_errors(target):
                move(new, target)
        finally:
            shutil.rmtree(new, ignore_errors=True)

    def _add(self, folder: Path) -> str:
        """Copy an episode from elsewhere; return its name here."""
        target = unused_path(self.path / EPISODES, folder.name)
        with locked(folder), disk_errors(target):
            copy_folder(folder, target)
        return target.name

    def _edit(self, name: str, change: Callable[[Edits], Edits]) -> None:
        change_edits(self._folder(name), change, self.setup)

    def _folder(self, name: str) -> Path:
        folder = self.path / EPISODES / check_name("episode", name)
        if not folder.is_dir():
            raise EpisodeError(f"there is no episode '{name}' in data set '{self.name}'")
        return folder

    def _folders(self, place: str) -> list[Path]:
        try:
            found = sorted((self.path / place).iterdir())
        except FileNotFoundError:
            return []
        except OSError as error:
            raise DataSetError(f"'{self.path / place}' cannot be read: {error.strerror}") from None
        return [folder for folder in found if folder.is_dir() and not folder.name.startswith(".")]


def _span(numbers: Mapping[int, Path]) -> str:
    return f"{min(numbers)}..{max(numbers)}" if numbers else "none"


def _by_name(shares: Sequence[tuple[str, float]]) -> dict[str, float]:
    parts: dict[str, float] = {}
    for name, share in shares:
        if name in parts:
            raise DataSetError(f"two parts have the name '{name}': give each its own")
        parts[name] = share
    return parts


def _counts(parts: Mapping[str, float], available: int) -> dict[str, int]:
    """Return the number of episodes of each part. Raises DataSetError."""
    total = sum(parts.values())
    are_counts = all(float(value).is_integer() for value in parts.values()) and total > 1
    if not all(value > 0 for value in parts.values()) or not parts or (not are_counts and total > 1 + 1e-9):
        raise DataSetError(f"cannot split into {dict(parts)}: give shares that sum to 1 at most, or whole numbers")
    if are_counts:
        counts = {part: int(value) for part, value in parts.items()}
    else:
        ends = np.rint(np.cumsum(list(parts.values())) * available).astype(int)
        counts = dict(zip(parts, (int(n) for n in np.diff(ends, prepend=0))))
    if sum(counts.values()) > available or min(counts.values()) < 1:
        raise DataSetError(f"{available} episodes with steps are too few to split into {dict(parts)}")
    return counts
