"""State of the source that a file was made with: its git commit, and whether the files differ from it."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

UNKNOWN = "unknown"
CHANGED = "+changes"
# Folders whose untracked files are source: what lies elsewhere, such as results, changes no measurement.
SOURCE_FOLDERS = ("src", "examples", "calibration")


@dataclass(frozen=True)
class SourceState:
    """Commit of a checkout, `unknown` outside one, and whether its files differ from that commit.

    dirty: True if a tracked file is changed, or a source file is not tracked; also True outside a checkout, where
    nobody can tell.
    """

    commit: str
    dirty: bool

    def __str__(self) -> str:
        return self.commit + (CHANGED if self.dirty and self.commit != UNKNOWN else "")

    def to_dict(self) -> dict[str, str | bool]:
        """Return plain values for a result or a card: `commit`, as text, and `dirty`."""
        return {"commit": str(self), "dirty": self.dirty}


def source_state(folder: Path | None = None) -> SourceState:
    """Find the state of the checkout that a folder lies in, by default this package's."""
    here = str(folder or Path(__file__).resolve().parent)
    untracked = [f":(top){name}" for name in SOURCE_FOLDERS]
    try:
        head = _git(here, "rev-parse", "HEAD")
        changed = _git(here, "status", "--porcelain", "--untracked-files=no")
        added = _git(here, "ls-files", "--others", "--exclude-standard", "--", *untracked)
    except (OSError, subprocess.SubprocessError):
        return SourceState(UNKNOWN, dirty=True)
    return SourceState(head, dirty=bool(changed or added))


def _git(folder: str, *arguments: str) -> str:
    done = subprocess.run(["git", "-C", folder, *arguments], capture_output=True, text=True, timeout=10, check=True)
    return done.stdout.strip()
