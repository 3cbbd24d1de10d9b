"""Freed memory goes back to the system."""

from __future__ import annotations

import platform
import re
from pathlib import Path

import pytest

from cliport_core.heap import trim_heap

MB = 1 << 20


def private_memory() -> int:
    status = Path("/proc/self/status").read_text()
    found = re.search(r"RssAnon:\s+(\d+) kB", status)
    assert found is not None
    return 1024 * int(found[1])


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="it is glibc's heap that is trimmed")
def test_what_lies_free_below_what_is_used_is_given_back() -> None:
    """Small pieces, the last of which stays: without trimming they stay the process's own."""
    pieces = [bytes(2000) for _ in range(50_000)]
    last, full = bytes(2000), private_memory()
    pieces.clear()
    trim_heap()
    assert private_memory() < full - 60 * MB and len(last) == 2000
