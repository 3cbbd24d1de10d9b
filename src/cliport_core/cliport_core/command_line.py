"""Parts that the command lines of all packages share: `--version`."""

from __future__ import annotations

import argparse
from importlib import metadata
from typing import Any

from cliport_core.source_state import UNKNOWN


def version() -> str:
    """Return the project's version, such as 0.1.0, as package.xml states it; `unknown` where nothing is installed."""
    try:
        return metadata.version("cliport_core")
    except metadata.PackageNotFoundError:
        return UNKNOWN


class CommandParser(argparse.ArgumentParser):
    """A parser that knows `--version`; otherwise as argparse's."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.add_argument("--version", action="version", version=f"CLIPort for ROS 2 {version()}")
