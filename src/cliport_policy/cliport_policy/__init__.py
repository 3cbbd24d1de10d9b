"""Language-conditioned pick and place: networks, training and offline inference.

policy = load_policy("default")
action = policy.infer(heightmap, "put the red blocks in a green bowl").action
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

# A thread of torch that waits must sleep, not spin: beside another busy program an action is up to five times as fast.
# Read when torch is first imported.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from cliport_policy.errors import PolicyError
from cliport_policy.inference import AffordanceMaps, Inference

if TYPE_CHECKING:
    from cliport_policy.policy import Policy, load_policy

__all__ = ["AffordanceMaps", "Inference", "Policy", "PolicyError", "load_policy"]


def __getattr__(name: str) -> Any:
    """Import what needs torch when it is asked for: that takes seconds, and who reads or writes data needs none."""
    if name in ("Policy", "load_policy"):
        return getattr(import_module("cliport_policy.policy"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
