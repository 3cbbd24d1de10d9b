"""Runs a module as `python -m` does, in a process that ends with the one that started it, however that one ends.

    python -m cliport_benchmark.with_parent PID MODULE [ARGUMENT...]

PID: of the process that starts this one.
"""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import sys
from collections.abc import Sequence

_PR_SET_PDEATHSIG = 1  # of <sys/prctl.h>


def command_with_parent(module: str, arguments: Sequence[str]) -> list[str]:
    """Return the command line by which this process runs a module that shall not outlive it."""
    return [sys.executable, "-m", "cliport_benchmark.with_parent", str(os.getpid()), module, *arguments]


def main() -> int:
    """Run the module; SIGTERM comes when the parent's thread that started this process has ended."""
    parent, module, *arguments = sys.argv[1:]
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):  # it ended before that was set
        return 1
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
