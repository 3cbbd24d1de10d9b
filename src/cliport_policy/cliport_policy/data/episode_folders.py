"""Folders named by people: data sets of episodes, single episodes, or bags that are neither."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cliport_episodes.data_set import DataSet
from cliport_episodes.data_set_file import FILE as DATA_SET_FILE
from cliport_episodes.episode_folder import EPISODES, step_paths
from cliport_policy.errors import DataError


def episodes_in(folder: Path) -> list[Path]:
    """Return the episodes of a data set in the order of their names, or the one that the folder is.

    The list is empty for any other folder.

    Raises:
        DataError: if a data set is empty.
    """
    if (folder / DATA_SET_FILE).is_file() or (folder / EPISODES).is_dir():  # which it can be made again from
        names = sorted(info.name for info in DataSet.open(folder).episodes())
        if not names:
            raise DataError(f"data set {folder} holds no episode: record some first")
        return [folder / EPISODES / name for name in names]
    return [folder.absolute()] if folder.is_dir() and step_paths(folder) else []


def find_episodes(folders: Sequence[Path]) -> list[Path]:
    """Return all episodes of data sets and single episodes.

    Raises:
        DataError: if a folder is neither, or an episode is there twice.
    """
    by_name: dict[str, Path] = {}
    for folder in folders:
        found = episodes_in(folder)
        if not found:
            raise DataError(f"{folder} is neither a data set ({DATA_SET_FILE}) nor an episode: record one first")
        for path in found:
            if path.name in by_name:
                twice = f"in {by_name[path.name].parent} and in {path.parent}"
                raise DataError(f"episode {path.name} is {twice}: give it once")
            by_name[path.name] = path
    return list(by_name.values())
