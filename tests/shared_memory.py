"""What lies in shared memory, and whether somebody still uses it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

SHARED = Path("/dev/shm")
_MUTEX = re.compile(r"sem\.(?P<port>.+)_mutex")


def shared_files() -> set[str]:
    """Return the names of all files of shared memory."""
    return {path.name for path in SHARED.iterdir()}


def is_used(name: str) -> bool:
    """Return whether a process that lives, this one too, has a file of shared memory mapped or open.

    The mutex of Fast DDS's port is open for moments alone: it is used as long as its port is.
    """
    mutex = _MUTEX.fullmatch(name)
    path = f"{SHARED}/{mutex['port'] if mutex else name}"
    processes = (process for process in Path("/proc").iterdir() if process.name.isdigit())
    return any(path in _mapped(process) or path in _open(process) for process in processes)


def _mapped(process: Path) -> str:
    with suppress(OSError):  # it has ended, or is somebody else's
        return (process / "maps").read_text()
    return ""


def _open(process: Path) -> Iterator[str]:
    with suppress(OSError):
        for descriptor in os.listdir(process / "fd"):
            with suppress(OSError):  # closed since, as that of this list is
                yield os.readlink(process / "fd" / descriptor)
