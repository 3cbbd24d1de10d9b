"""Origin of a file: command line and machine; cliport_core.source_state says of which source."""

from __future__ import annotations

import os
import platform
import shlex
import sys
from pathlib import Path


def command_line(program: str, arguments: list[str]) -> str:
    """Return the command as one would type it."""
    return shlex.join(["ros2", "run", "cliport_benchmark", program, *arguments])


def machine() -> dict[str, str | int]:
    """Return processor, cores and versions that matter for a measurement."""
    return {
        "cpu": _cpu_name(),
        "cores": os.cpu_count() or 1,
        "system": platform.platform(),
        "python": sys.version.split()[0],
    }


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
