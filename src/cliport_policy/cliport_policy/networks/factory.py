"""Construction of a network from its config, with the shared encoders it needs."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from cliport_policy.blank import blank_modules
from cliport_policy.checkpoint import network_tensors
from cliport_policy.color_words import load_color_head
from cliport_policy.config import PRECISIONS, NetworkConfig
from cliport_policy.encoders.files import models_folder
from cliport_policy.encoders.registry import shared_encoders, with_available_encoder
from cliport_policy.errors import CheckpointError, ConfigError
from cliport_policy.joint_config import JointConfig
from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.compact.network import CompactNetwork
from cliport_policy.networks.joint.network import JointNetwork
from cliport_policy.networks.policy_network import PolicyNetwork
from cliport_policy.networks.streams.network import StreamsNetwork
from cliport_policy.settings import check_choice


def build_network(config: AnyNetworkConfig) -> PolicyNetwork:
    """Make a new network of random weights.

    If its config has a fallback encoder, `network.config` names the encoder in use.

    Raises:
        EncoderError: naming file and remedy, if the encoders can't be had.
    """
    if isinstance(config, NetworkConfig):
        return CompactNetwork(config)
    if isinstance(config, JointConfig):
        network = JointNetwork(config)
        if network.color_maps is not None:
            network.color_maps.head.load_state_dict(load_color_head(config.color_words).state_dict())
        return network
    config = with_available_encoder(config)
    return StreamsNetwork(config, shared_encoders(config))


def restore_network(
    config: AnyNetworkConfig, tensors: Mapping[str, Tensor], frozen: str, path: Path, precision: str = "auto"
) -> PolicyNetwork:
    """Make the network of a checkpoint, ready to act.

    precision: `float32`, `bfloat16`, or `auto`: bfloat16 if this CPU is fast at it. The compact network is always in
    float32, and so are the joint network's weights.

    Raises:
        CheckpointError: if the tensors or the present frozen encoders are not those of the card.
        EncoderError: if there are no encoders.
    """
    check_choice(precision, PRECISIONS, "precision")
    network, dtype = _network_without_weights(config, precision)
    if network.encoder_identity != frozen:
        raise CheckpointError(
            f"checkpoint {path} was trained on the encoders '{frozen}'; here are '{network.encoder_identity}': "
            f"put the files it was trained on into {models_folder()}"
        )
    try:
        weights = {name: _cast(tensor, dtype) for name, tensor in network_tensors(tensors).items()}
        network.load_state_dict(weights, assign=True)
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:200]
        raise CheckpointError(
            f"checkpoint {path} does not fit its card ({reason}): restore it or train again"
        ) from error
    return network.requires_grad_(False)


def _network_without_weights(config: AnyNetworkConfig, precision: str) -> tuple[PolicyNetwork, torch.dtype]:
    """Return a network whose weights take no memory yet, and the type that they shall have."""
    if isinstance(config, NetworkConfig):
        with blank_modules():
            return CompactNetwork(config), torch.float32
    fast = precision == "bfloat16" or (precision == "auto" and has_fast_bfloat16())
    if isinstance(config, JointConfig):
        with blank_modules():
            joint = JointNetwork(config)
        joint.acts_in_bfloat16 = fast
        return joint, torch.float32
    dtype = torch.bfloat16 if fast else torch.float32
    encoders = shared_encoders(config, dtype)
    with blank_modules():
        return StreamsNetwork(config, encoders), dtype


def compile_network(network: PolicyNetwork) -> None:
    """Have a network's nets compiled at their first use.

    Raises:
        ConfigError: if there is no C++ compiler.
    """
    compiler = os.environ.get("CXX") or "g++"
    if shutil.which(compiler) is None:
        raise ConfigError(f"compile: true needs the C++ compiler {compiler}: install it, or leave compile out")
    network.compile_parts()


def has_fast_bfloat16() -> bool:
    """Return True if this CPU multiplies in bfloat16: twice as fast, and weights take half the memory."""
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16") or capabilities.get("amx_tile"))


def _cast(tensor: Tensor, dtype: torch.dtype) -> Tensor:
    return tensor.to(dtype) if tensor.is_floating_point() else tensor
