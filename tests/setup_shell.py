"""Run functions of tools/setup in a checkout of the test's own."""

from __future__ import annotations

import os
import subprocess
from contextlib import suppress
from pathlib import Path

TOOLS = Path(__file__).parents[1] / "tools"
PARTS = ("steps", "choice", "python", "system")
SOURCED = "".join(f". $TOOLS/setup_{part}.sh; " for part in PARTS)


def shell(script: str, folder: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a script with setup's functions, as `set -u` would, in a checkout at a folder."""
    return subprocess.run(
        ["bash", "-uc", SOURCED + script],
        env=_variables(folder, variables),
        cwd=folder,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=60,
    )


def _variables(folder: Path, more: dict[str, str]) -> dict[str, str]:
    names = {"TOOLS": str(TOOLS), "root": str(folder), "venv": f"{folder}/.venv", "stamps": f"{folder}/.setup"}
    defaults = {"ros": "wheels", "for_tests": "", "lacking": "", "PYTHON": "", "extras": "runtime simulate"}
    return {"PATH": os.environ["PATH"], **defaults, **names, **more}


def program(path: Path, lines: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/bash\n{lines}\n")
    path.chmod(0o755)
    return path


def on_a_terminal(script: str, folder: Path, typed: str, **variables: str) -> tuple[int, str]:
    """Run a script as `shell` does, on a terminal at which somebody types; return its status and what stands there."""
    mine, its = os.openpty()
    process = subprocess.Popen(
        ["bash", "-uc", SOURCED + script],
        env=_variables(folder, variables),
        cwd=folder,
        preexec_fn=lambda: os.login_tty(its),
    )
    os.close(its)
    os.write(mine, typed.encode())
    shown = b""
    with suppress(OSError):  # which says that nobody holds the terminal any more
        while read := os.read(mine, 4096):
            shown += read
    os.close(mine)
    return process.wait(60), shown.decode().replace("\r\n", "\n")
