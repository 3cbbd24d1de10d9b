"""Memory that a process holds, as the system counts it."""

from __future__ import annotations

from pathlib import Path


def memory_mb(kind: str, process: int | str = "self") -> float:
    """Return a line of a process's status [MB]: `VmRSS`, all that it holds, or `RssAnon`, what is its own."""
    status = Path(f"/proc/{process}/status").read_text()
    return next(int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith(kind))
