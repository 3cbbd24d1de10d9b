"""The simulator's parameters with the watch times that hold on hardware."""

from __future__ import annotations

from pathlib import Path

from sim_settings import shipped_settings, written

ROOT = Path(__file__).resolve().parents[1]


def with_hardware_times(folder: Path, patient: bool = False, **executor: float) -> Path:
    """Return a copy of sim.yaml without the longer times that it grants the simulator.

    patient: the executor keeps its own long ones, so that on a busy machine it does move; who watches it has the short.
    executor: further parameters of its own.
    """
    settings = shipped_settings()
    del settings["/panda_guard"]
    own = settings.pop("/panda_executor")["ros__parameters"]
    kept = own if patient else {}
    if kept or executor:
        settings["/panda_executor"] = {"ros__parameters": {**kept, **executor}}
    del settings["/sim_bridge"]["ros__parameters"]["heartbeat_timeout"]
    return written(settings, folder)
