"""The simulator's parameters with the watch times that hold on hardware."""

from __future__ import annotations

from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]


def with_hardware_times(folder: Path) -> Path:
    """Return a copy of sim.yaml without the longer times that it grants the simulator."""
    settings = yaml.safe_load((ROOT / "src/cliport_bringup/config/sim.yaml").read_text())
    del settings["/panda_executor"], settings["/panda_guard"]
    del settings["/sim_bridge"]["ros__parameters"]["heartbeat_timeout"]
    path = folder / "params.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path
