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


def with_slower_rates(folder: Path, factor: float) -> Path:
    """Return a copy of sim.yaml whose pictures, clock and joint states come so many times less often."""
    settings = shipped_settings()
    simulator = settings["/sim_bridge"]["ros__parameters"]
    simulator["camera_rate"] /= factor
    simulator |= dict.fromkeys(("clock_rate", "joint_state_rate"), 50.0 / factor)
    return written(settings, folder)
