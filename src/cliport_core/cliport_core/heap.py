"""Return of freed memory to the system: what one goal or scene needed at most would else stay a process's own."""

from __future__ import annotations

import ctypes


def trim_heap() -> None:
    """Return freed heap to the system; takes some ms. Does nothing unless the system is a Linux with glibc."""
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    except (OSError, AttributeError):
        return
