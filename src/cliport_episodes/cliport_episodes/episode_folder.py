"""An episode's folder: the names of its files, its lock, its edits and its setup."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import re
import secrets
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from cliport_episodes.bag_file import BagFile, describe
from cliport_episodes.bag_metadata import FILE as METADATA
from cliport_episodes.bag_metadata import read_custom_data, write_metadata
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.disk import disk_errors
from cliport_episodes.edits import SETUP, Edits
from cliport_episodes.errors import (
    BagError,
    EpisodeBusyError,
    EpisodeError,
    LaterFormatError,
    NoMetadataError,
    SetupError,
)

EPISODES, TRASH = "episodes", "trash"  # folders of a data set
UNDONE = "undone"  # a folder beside them: undone steps, in folders with their episodes' names
FINAL = "final.mcap"
_LOCK = ".lock"  # in an episode's folder
_NO_FILE = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOSPC, errno.EDQUOT)  # why there can be none
_STEP = re.compile(r"step_(\d{3,9})\.mcap")


def new_name(moment: datetime) -> str:
    """Make a new episode's name: it sorts by the time at which the episode began, and ends at random."""
    return f"{moment:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"


def step_name(number: int) -> str:
    """Return the name of a step's file."""
    return f"step_{number:03d}.mcap"


def step_paths(folder: Path) -> dict[int, Path]:
    """Return the files of the steps by number, in order.

    Raises:
        EpisodeError: when there is no such folder.
    """
    try:
        found = ((_STEP.fullmatch(path.name), path) for path in folder.iterdir())
        return dict(sorted((int(match[1]), path) for match, path in found if match))
    except (FileNotFoundError, NotADirectoryError):
        raise EpisodeError(f"there is no episode '{folder.name}'") from None


def undone_paths(folder: Path, number: int) -> list[Path]:
    """Return the files of undone steps of a number, the one undone last at the end."""
    place = folder.parent.parent / UNDONE / folder.name
    return sorted(place.glob(f"step_{number:03d}.*.mcap"), key=lambda path: (len(path.name), path.name))


def next_undone_path(folder: Path, number: int) -> Path:
    """Return the unused path to which the step of a number moves when it is undone."""
    earlier = undone_paths(folder, number)
    count = int(earlier[-1].name.split(".")[1]) + 1 if earlier else 1
    return folder.parent.parent / UNDONE / folder.name / f"step_{number:03d}.{count}.mcap"


def whole_files(folder: Path) -> tuple[dict[int, BagFile], BagFile | None]:
    """Return the steps' files by number, and the final one, without those that are torn."""
    steps: dict[int, BagFile] = {}
    final = None
    for number, path in step_paths(folder).items():
        with suppress(BagError):
            steps[number] = describe(path)
    with suppress(BagError):
        final = describe(folder / FINAL)
    return steps, final


def read_edits(folder: Path) -> tuple[Edits, str | None]:
    """Read the edits of an episode, and a complaint where they are lost."""
    try:
        return Edits.from_custom_data(read_custom_data(folder)), None
    except BagError as error:
        return Edits(
            finished=(folder / FINAL).exists()
        ), f"{error}: marks, relabelled instructions and trims are not known"


def edits_to_change(folder: Path) -> Edits:
    """Read the edits of an episode that is about to be written.

    A metadata.yaml that is damaged is kept beside the new one, as metadata.yaml.unreadable.

    Raises:
        EpisodeError: when a later version of this software made them, whose edits this one would lose.
        OSError: when the disk refuses.
    """
    try:
        return Edits.from_custom_data(read_custom_data(folder))
    except LaterFormatError as error:
        raise EpisodeError(f"episode '{folder.name}' is not changed: {error}") from None
    except NoMetadataError:
        pass
    except BagError:
        shutil.copy2(folder / METADATA, unused_path(folder, f"{METADATA}.unreadable"))
    return read_edits(folder)[0]


def read_own_setup(folder: Path) -> CaptureSetup | None:
    """Read the setup that an episode carries itself; None where that is lost."""
    try:
        return CaptureSetup.from_dict(json.loads(read_custom_data(folder)[SETUP]))
    except (BagError, SetupError, KeyError, TypeError, ValueError):
        return None


def custom_data(edits: Edits, setup: CaptureSetup) -> Mapping[str, str]:
    """Return the `custom_data` of metadata.yaml: the edits and the setup."""
    return {**edits.to_custom_data(), SETUP: json.dumps(setup.to_dict())}


def change_edits(
    folder: Path, change: Callable[[Edits], Edits], setup: CaptureSetup, edited_ns: int | None = None
) -> None:
    """Change the edits of an episode; its raw files are not touched. edited_ns: since the epoch; None: now.

    Raises:
        EpisodeError: when the present edits cannot be read. EpisodeBusyError, DiskError.
    """
    with locked(folder), disk_errors(folder):
        changed = change(edits_to_change(folder))
        edits = replace(changed, edited_ns=time.time_ns() if edited_ns is None else edited_ns)
        steps, final = whole_files(folder)
        files = list(steps.values())
        if final is not None and edits.finished:
            files.append(final)
        write_metadata(folder, files, custom_data(edits, read_own_setup(folder) or setup))


class FolderLock:
    """Exclusive right to write an episode, until it is released or the process ends.

    It is held on a hidden file, because network file systems lock only what may be written; where there can be none, as
    on a disk that is read only, on the folder itself.
    """

    def __init__(self, folder: Path) -> None:
        """Take the lock. Raises EpisodeBusyError, EpisodeError."""
        self._descriptor: int | None = None
        try:
            try:
                self._descriptor = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
            except OSError as error:
                if error.errno not in _NO_FILE:
                    raise
                self._descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (FileNotFoundError, NotADirectoryError):
            raise EpisodeError(f"there is no episode '{folder.name}'") from None
        except OSError as error:
            self.release()
            if isinstance(error, BlockingIOError):
                raise EpisodeBusyError(folder) from None
            raise EpisodeError(
                f"episode '{folder.name}' cannot be locked against other programs ({error.strerror}): keep the "
                "data set on a local disk, or on a network one that has locks"
            ) from None

    def release(self) -> None:
        """Give the lock back; may be called twice."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock an episode while the body runs. Raises EpisodeBusyError, EpisodeError."""
    lock = FolderLock(folder)
    try:
        yield
    finally:
        lock.release()


def unused_path(folder: Path, name: str) -> Path:
    """Return an unused path in a folder: the name, or that with the lowest number that makes it unused."""
    path, number = folder / name, 1
    while path.exists():
        number += 1
        path = folder / f"{name}-{number}"
    return path
