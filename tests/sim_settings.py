"""The simulator's parameters file, to be changed and given to a graph."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

SHIPPED = Path(__file__).resolve().parents[1] / "src/cliport_bringup/config/sim.yaml"


def shipped_settings() -> dict[str, Any]:
    """Return sim.yaml's parameters, by node."""
    settings: dict[str, Any] = yaml.safe_load(SHIPPED.read_text())
    return settings


def written(settings: dict[str, Any], folder: Path) -> Path:
    """Write parameters to a file that sim.launch.yaml takes as params:=, and return its path."""
    path = folder / "params.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path
