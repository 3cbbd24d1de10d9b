"""Language-conditioned pick and place: networks, training and offline inference.

policy = load_policy("default")
action = policy.infer(heightmap, "put the red blocks in a green bowl")
"""

from cliport_policy.action import AffordanceMaps, PickPlaceAction
from cliport_policy.errors import PolicyError
from cliport_policy.policy import Policy, load_policy

__all__ = ["AffordanceMaps", "PickPlaceAction", "Policy", "PolicyError", "load_policy"]
