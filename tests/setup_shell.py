"""Run functions of tools/setup in a checkout of the test's own."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

TOOLS = Path(__file__).parents[1] / "tools"
PARTS = ("steps", "choice", "python", "system")
SOURCED = "".join(f". $TOOLS/setup_{part}.sh; " for part in PARTS)


def shell(script: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a script with setup's functions, as `set -u` would, in a checkout at a folder."""
    names = {"TOOLS": str(TOOLS), "root": str(folder), "venv": f"{folder}/.venv", "stamps": f"{folder}/.setup"}
    defaults = {"ros": "wheels", "for_tests": "", "lacking": "", "PYTHON": "", "extras": "runtime simulate"}
    return subprocess.run(
        ["bash", "-uc", SOURCED + script],
        env={"PATH": os.environ["PATH"], **defaults, **names, **variables},
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=60,
    )


def program(path: Path, lines: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/bash\n{lines}\n")
    path.chmod(0o755)
    return path
