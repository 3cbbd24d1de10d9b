"""What made a file: command line, commit, machine."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
from pathlib import Path


def command_line(program: str, arguments: list[str]) -> str:
    """The command as one would type it."""
    return shlex.join(["ros2", "run", "cliport_benchmark", program, *arguments])


def commit() -> str:
    """The source's git commit, with "+changes" when files differ from it; "unknown" outside a checkout."""
    here = str(Path(__file__).resolve().parent)
    try:
        head = _git(here, "rev-parse", "HEAD")
        changed = _git(here, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return head + ("+changes" if changed else "")


def machine() -> dict[str, str | int]:
    """Processor, cores and versions that matter for a measurement."""
    return {
        "cpu": _cpu_name(),
        "cores": os.cpu_count() or 1,
        "system": platform.platform(),
        "python": sys.version.split()[0],
    }


def _git(folder: str, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", folder, *arguments], capture_output=True, text=True, timeout=10, check=True)
    return done.stdout.strip()


def _cpu_name() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
