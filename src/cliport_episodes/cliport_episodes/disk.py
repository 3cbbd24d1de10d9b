"""Durable writing: after a power failure a file is the old or the new one, never half of either."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cliport_core.whole_file import UNFINISHED, sync, whole_file
from cliport_episodes.errors import DiskError, DiskFullError

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def disk_errors(path: Path) -> Iterator[None]:
    """Turn an OSError of the body into a `DiskError` about `path`, or a `DiskFullError` where space lacks."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        if error.errno in _FULL:
            raise DiskFullError(path, reason, "Free some space and do the last step again") from None
        raise DiskError(path, reason, "Check the folder and its permissions") from None


def move(source: Path, target: Path) -> None:
    """Rename within one disk; the new name is on the disk when this returns."""
    os.replace(source, target)
    sync(target.parent)
    if source.parent != target.parent:
        with suppress(FileNotFoundError):
            sync(source.parent)


def replace_text(path: Path, text: str) -> None:
    """Replace a text file as a whole: a reader gets the old or the new one at any moment."""
    replace_bytes(path, text.encode())


def replace_bytes(path: Path, content: bytes) -> None:
    """Replace a file as a whole, as `replace_text` does."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def copy_folder(source: Path, target: Path) -> None:
    """Copy a flat folder's files, by hard links where the disk has them, so that `target` appears as a whole."""
    new = target.with_name(f".{target.name}{UNFINISHED}")
    shutil.rmtree(new, ignore_errors=True)
    try:
        new.mkdir(parents=True)
        for file in sorted(source.iterdir()):
            if file.is_file() and not file.name.startswith("."):
                _link_or_copy(file, new / file.name)
        sync(new)
        os.rename(new, target)
        sync(target.parent)
    except OSError:
        shutil.rmtree(new, ignore_errors=True)
        raise


def _link_or_copy(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
        sync(target)
