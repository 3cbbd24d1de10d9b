"""Language-conditioned pick and place: networks, training and offline inference.

policy = load_policy("default")
action = policy.infer(heightmap, "put the red blocks in a green bowl").action
"""

import os

# A thread of torch that waits must sleep, not spin: beside another busy program an action is up to five times as fast.
# Read when torch is first imported.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

from cliport_policy.errors import PolicyError
from cliport_policy.inference import AffordanceMaps, Inference
from cliport_policy.policy import Policy, load_policy

__all__ = ["AffordanceMaps", "Inference", "Policy", "PolicyError", "load_policy"]
