"""An episode's folder: its files' names, its lock, and what it says of itself."""

from __future__ import annotations

import fcntl
import json
import os
import re
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from cliport_episodes.bag_file import BagFile, describe
from cliport_episodes.bag_metadata import read_custom_data, write_metadata
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.disk import disk_errors
from cliport_episodes.edits import Edits
from cliport_episodes.errors import BagError, EpisodeBusyError, EpisodeError, SetupError

EPISODES, TRASH = "episodes", "trash"  # folders of a data set
FINAL = "final.mcap"
_STEP = re.compile(r"step_(\d{3,9})\.mcap")
_SETUP = "setup"


def new_name(moment: datetime) -> str:
    """A name that sorts by the time at which the episode began, and that no other has."""
    return f"{moment:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"


def step_name(number: int) -> str:
    """The name of a step's file."""
    return f"step_{number:03d}.mcap"


def step_paths(folder: Path) -> dict[int, Path]:
    """The files of the steps by number, in order.

    Raises:
        EpisodeError: when there is no such folder.
    """
    try:
        found = ((_STEP.fullmatch(path.name), path) for path in folder.iterdir())
        return dict(sorted((int(match[1]), path) for match, path in found if match))
    except (FileNotFoundError, NotADirectoryError):
        raise EpisodeError(f"there is no episode '{folder.name}'") from None


def whole_files(folder: Path) -> tuple[dict[int, BagFile], BagFile | None]:
    """The steps' files by number, and the final one, without those that are torn."""
    steps: dict[int, BagFile] = {}
    final = None
    for number, path in step_paths(folder).items():
        with suppress(BagError):
            steps[number] = describe(path)
    with suppress(BagError):
        final = describe(folder / FINAL)
    return steps, final


def read_edits(folder: Path) -> tuple[Edits, str | None]:
    """What was edited, and what is amiss with that."""
    try:
        return Edits.from_custom_data(read_custom_data(folder)), None
    except BagError as error:
        return Edits(finished=(folder / FINAL).exists()), f"{error}: marks, relabelled instructions and trims are lost"


def read_own_setup(folder: Path) -> CaptureSetup | None:
    """The setup that an episode carries itself; None where that is lost."""
    try:
        return CaptureSetup.from_dict(json.loads(read_custom_data(folder)[_SETUP]))
    except (BagError, SetupError, KeyError, TypeError, ValueError):
        return None


def custom_data(edits: Edits, setup: CaptureSetup) -> Mapping[str, str]:
    """All that metadata.yaml says beyond what rosbag2 does."""
    return {**edits.to_custom_data(), _SETUP: json.dumps(setup.to_dict())}


def change_edits(folder: Path, change: Callable[[Edits], Edits], setup: CaptureSetup) -> None:
    """Replace what is edited of an episode; its raw files are not touched. Raises EpisodeBusyError, DiskError."""
    with locked(folder), disk_errors(folder):
        edits = change(read_edits(folder)[0])
        steps, final = whole_files(folder)
        files = [*steps.values(), *([final] if final and edits.finished else [])]
        write_metadata(folder, files, custom_data(edits, read_own_setup(folder) or setup))


class FolderLock:
    """Holds an episode against other writers, until it is released or its process ends."""

    def __init__(self, folder: Path) -> None:
        """Raises EpisodeBusyError, EpisodeError."""
        self._descriptor: int | None = None
        try:
            self._descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (FileNotFoundError, NotADirectoryError):
            raise EpisodeError(f"there is no episode '{folder.name}'") from None
        except OSError as error:
            self.release()
            if isinstance(error, BlockingIOError):
                raise EpisodeBusyError(folder) from None
            raise EpisodeError(f"episode '{folder.name}' cannot be held for writing: {error.strerror}") from None

    def release(self) -> None:
        """Let others write; may be called twice."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold an episode for a moment. Raises as `FolderLock` does."""
    lock = FolderLock(folder)
    try:
        yield
    finally:
        lock.release()


def free_path(folder: Path, name: str) -> Path:
    """A path in a folder that nothing has, with the name or one like it."""
    names = (name, *(f"{name}-{number}" for number in range(2, 10_000)))
    return next(path for path in (folder / each for each in names) if not path.exists())
