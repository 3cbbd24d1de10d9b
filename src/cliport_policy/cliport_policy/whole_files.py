"""Checkpoints and their cards as files that appear whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError

from cliport_core import whole_file as core
from cliport_policy.errors import CheckpointError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` that replaces it if the block succeeds, and is removed otherwise.

    Raises:
        CheckpointError: if the file can't be written, as on a full disk.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with core.whole_file(path) as temporary:
            yield temporary
    except (OSError, SafetensorError) as error:
        reason = " ".join(str(error).split())[:160]
        raise CheckpointError(
            f"can't write {path} ({reason}): make room and run again; what was saved before is kept"
        ) from error


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Write a JSON file that appears whole or not at all.

    Raises:
        CheckpointError: if it can't be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(json_text(values))


def json_text(values: dict[str, Any]) -> str:
    """Return values as the text of a JSON file."""
    return json.dumps(values, indent=2) + "\n"
