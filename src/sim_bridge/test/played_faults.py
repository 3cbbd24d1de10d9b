"""Faults of the simulator without a node: switches that a test sets itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from sim_bridge.joint_state_faults import JointStateFaults


def played_faults(*on: str, clock_shift: float = 0.0) -> Any:
    """Return what stands in for FaultInjection; on: the names of the switches that are on."""
    states = JointStateFaults(lambda fault: f"joint_states_{fault.value}" in on)
    return SimpleNamespace(states=states, clock_shift=clock_shift, is_on=lambda name: name in on)
