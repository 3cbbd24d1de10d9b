"""Return of memory to the system that loading took and acting does not need."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from pathlib import Path

from cliport_core.heap import trim_heap

_MAPS = Path("/proc/self/smaps")
_HEADER = re.compile(r"^([0-9a-f]+)-([0-9a-f]+) (\S{4}) \S+ \S+ \d+ +(.+\.so[.\d]*)$")
_MADV_DONTNEED = 4


def release_unused() -> None:
    """Return freed heap, and forget pages of shared libraries that nothing has written.

    A page that is needed again is mapped again from the system's cache. Loading torch reads 100 MB of GPU libraries
    that a CPU never comes back to. Does nothing unless the system is a Linux with glibc.
    """
    trim_heap()
    try:
        libc = ctypes.CDLL("libc.so.6")
        for start, end in list(_clean_library_pages()):
            libc.madvise(ctypes.c_void_p(start), ctypes.c_size_t(end - start), _MADV_DONTNEED)
    except (OSError, AttributeError):
        return


def _clean_library_pages() -> Iterator[tuple[int, int]]:
    """Yield address ranges of libraries that can't be written now and hold no page of this process's own."""
    found: tuple[int, int] | None = None
    for line in _MAPS.read_text().splitlines():
        if line[:1] in "0123456789abcdef":
            header = _HEADER.match(line)
            clean = header is not None and header[3] in ("r--p", "r-xp")
            found = (int(header[1], 16), int(header[2], 16)) if header and clean else None
        elif line.startswith("Anonymous:") and found and line.split()[1] == "0":
            yield found
