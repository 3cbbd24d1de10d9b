"""Memory that a process holds and processor time that it took, as the system counts them."""

from __future__ import annotations

import os
from pathlib import Path


def memory_mb(kind: str, process: int | str = "self") -> float:
    """Return a line of a process's status [MB]: `VmRSS`, all that it holds, or `RssAnon`, what is its own."""
    status = Path(f"/proc/{process}/status").read_text()
    return next(int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith(kind))


def processor_seconds(process: int) -> float:
    """Return the processor time that a process has taken, in itself and for the system [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
