"""How many heaps the C library keeps for a process."""

from __future__ import annotations

import ctypes

_ARENA_MAX = -8  # mallopt(3)


def keep_one_heap() -> bool:
    """Let all threads share one heap; call it before they are started.

    Pictures pass through threads that come and go with the pages that are open. With a heap for each, which glibc
    keeps by default, memory grows for as long as pages are opened. False, and nothing changes, without glibc.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    return bool(mallopt(_ARENA_MAX, 1))
