"""Origin of a file: command line and machine; cliport_core.source_state says of which source."""

from __future__ import annotations

import os
import platform
import shlex
import sys
from pathlib import Path

INSTRUCTION_SETS = ("avx2", "avx512f", "avx512_bf16", "amx_bf16")  # how fast networks are depends on these
_PROCESSOR_FILE = Path("/proc/cpuinfo")


def command_line(program: str, arguments: list[str]) -> str:
    """Return the command as one would type it."""
    return shlex.join(["ros2", "run", "cliport_benchmark", program, *arguments])


def machine() -> dict[str, str | int]:
    """Return processor, cores that may be used, and versions that matter for a measurement.

    instructions: those of INSTRUCTION_SETS that the processor has, with blanks between them.
    """
    return {
        "cpu": _processor_line("model name") or platform.processor() or platform.machine(),
        "instructions": " ".join(name for name in INSTRUCTION_SETS if name in _processor_line("flags").split()),
        "cores": len(os.sched_getaffinity(0)),
        "system": platform.platform(),
        "python": sys.version.split()[0],
    }


def machine_line() -> str:
    """Return processor, instruction sets and cores as one line, to stand above figures."""
    found = machine()
    return (
        f"{found['cpu']} ({found['instructions'] or 'none of ' + ', '.join(INSTRUCTION_SETS)}), {found['cores']} cores"
    )


def _processor_line(name: str) -> str:
    """Return what Linux says of the first processor under a name; empty where it says nothing."""
    try:
        for line in _PROCESSOR_FILE.read_text().splitlines():
            key, _, value = line.partition(":")
            if key.strip() == name:
                return value.strip()
    except OSError:
        pass
    return ""
