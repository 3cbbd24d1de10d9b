"""Packages and their executables, found through the ament index."""

from __future__ import annotations

import os
from pathlib import Path

from ros2cli_small.errors import CommandError


def find_prefix(package: str) -> Path:
    """Return the prefix that a package is installed in."""
    marker = Path("share", "ament_index", "resource_index", "packages", package)
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if package and prefix and (Path(prefix) / marker).is_file():
            return Path(prefix)
    raise CommandError(f"Package '{package}' not found")


def find_share(package: str) -> Path:
    """Return a package's share folder."""
    return find_prefix(package) / "share" / package


def find_executable(package: str, name: str) -> Path:
    """Return the executable of that name in a package's lib folder."""
    folder = find_prefix(package) / "lib" / package
    found = [path for path in sorted(folder.rglob(name)) if path.is_file() and os.access(path, os.X_OK)]
    if not found:
        raise CommandError("No executable found")
    if len(found) > 1:
        listing = "\n".join(f"- {path}" for path in found)
        raise CommandError(f"Multiple executables found:\n{listing}")
    return found[0]
