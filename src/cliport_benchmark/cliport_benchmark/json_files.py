"""JSON files: written whole or not at all, read with one clear line when they cannot be, and compared."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_core.whole_file import whole_file


def write_json(path: Path, value: dict[str, Any]) -> None:
    """Write a JSON file that appears whole or not at all.

    Raises:
        DataFolderError: when the place cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(value, indent=2) + "\n")
    except OSError as error:
        raise DataFolderError(f"cannot write {path}: {error.strerror or error}") from error


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        DataFolderError: when the file is absent or no JSON object.
    """
    try:
        value = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise DataFolderError(f"cannot read {path}: {error}") from error
    if not isinstance(value, dict):
        raise DataFolderError(f"{path} holds no JSON object")
    return value


def check_writable(path: Path) -> None:
    """Make the folder of a file that results will be written to.

    Raises:
        OptionError: when the file cannot be written there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OptionError(f"cannot write --out {path}: {error.strerror or error}") from error
    if path.is_dir():
        raise OptionError(f"cannot write --out {path}: it is a folder; name a file")
    if not os.access(path.parent, os.W_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise OptionError(f"cannot write --out {path}: permission denied")


def as_json(values: dict[str, Any]) -> dict[str, Any]:
    """Return values as they are after a way through a file."""
    result: dict[str, Any] = json.loads(json.dumps(values))
    return result


def differences(found: dict[str, Any], wanted: dict[str, Any]) -> str:
    """Compare two sets of settings and return the differences in words; "" when there are none."""
    wanted = as_json(wanted)
    names = [name for name in {**wanted, **found} if found.get(name) != wanted.get(name)]
    return ", ".join(f"{name} {_short(found.get(name))} not {_short(wanted.get(name))}" for name in names)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 40 else text[:37] + "..."
