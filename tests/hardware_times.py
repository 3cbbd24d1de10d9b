"""The simulator's parameters with the watch times that hold on hardware."""

from __future__ import annotations

from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]


def with_hardware_times(folder: Path, patient: bool = False) -> Path:
    """Return a copy of sim.yaml without the longer times that it grants the simulator.

    patient: the executor keeps its own long ones, so that on a busy machine it does move; who watches it has the short.
    """
    settings = yaml.safe_load((ROOT / "src/cliport_bringup/config/sim.yaml").read_text())
    del settings["/panda_guard"]
    if not patient:
        del settings["/panda_executor"]
    del settings["/sim_bridge"]["ros__parameters"]["heartbeat_timeout"]
    path = folder / "params.yaml"
    path.write_text(yaml.safe_dump(settings))
    return path
