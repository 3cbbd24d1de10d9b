"""A joint network that is small enough for tests."""

import torch

from cliport_policy.named_configs import load_network_config
from cliport_policy.networks.factory import build_network
from cliport_policy.networks.joint.network import JointNetwork

SMALL = {
    "widths": (8, 12, 16),
    "decoder_width": 8,
    "goal_dim": 16,
    "crop_pixels": 16,
    "query_cells": 9,
    "n_rotations": 8,
}


def small_joint_network(**changes: object) -> JointNetwork:
    torch.manual_seed(0)
    network = build_network(load_network_config("multi", {**SMALL, **changes}))
    assert isinstance(network, JointNetwork)
    return network.eval()
