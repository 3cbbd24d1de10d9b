"""From a config to its network, with the shared encoders it needs."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from cliport_policy.blank import blank_modules
from cliport_policy.checkpoint import ANCHORS
from cliport_policy.config import NetworkConfig
from cliport_policy.encoders.files import models_folder
from cliport_policy.encoders.registry import encoders_of, on_hand
from cliport_policy.errors import CheckpointError, ConfigError
from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.compact import CompactNetwork
from cliport_policy.networks.policy_network import PolicyNetwork
from cliport_policy.networks.streams import StreamsNetwork
from cliport_policy.settings import check_choice

PRECISIONS = ("auto", "float32", "bfloat16")


def build_network(config: AnyNetworkConfig) -> PolicyNetwork:
    """A new network, its weights random. `network.config` says on which encoders it stands where there is a choice.

    Raises EncoderError, naming file and remedy, where the encoders can't be had.
    """
    if isinstance(config, NetworkConfig):
        return CompactNetwork(config)
    config = on_hand(config)
    return StreamsNetwork(config, encoders_of(config))


def restore_network(
    config: AnyNetworkConfig, tensors: Mapping[str, Tensor], frozen: str, path: Path, precision: str = "auto"
) -> PolicyNetwork:
    """The network of a checkpoint, ready to act. precision: `float32`, `bfloat16`, or `auto`: what is fast here.

    The compact network is always in float32. Raises CheckpointError where the tensors or the frozen encoders on hand
    are not those of the card, EncoderError where there are no encoders.
    """
    check_choice(precision, PRECISIONS, "precision")
    network, dtype = _empty(config, precision)
    if network.encoder_identity != frozen:
        raise CheckpointError(
            f"checkpoint {path} was trained on the encoders '{frozen}'; here are '{network.encoder_identity}': "
            f"put the files it was trained on into {models_folder()}"
        )
    try:
        weights = {name: _as(tensors[name], dtype) for name in tensors if name != ANCHORS}
        network.load_state_dict(weights, assign=True)
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:200]
        raise CheckpointError(
            f"checkpoint {path} does not fit its card ({reason}): restore it or train again"
        ) from error
    return network.requires_grad_(False)


def _empty(config: AnyNetworkConfig, precision: str) -> tuple[PolicyNetwork, torch.dtype]:
    """A network whose weights take no memory yet, and the type that they shall have."""
    if isinstance(config, NetworkConfig):
        with blank_modules():
            return CompactNetwork(config), torch.float32
    fast = precision == "bfloat16" or (precision == "auto" and has_fast_bfloat16())
    dtype = torch.bfloat16 if fast else torch.float32
    encoders = encoders_of(config, dtype)
    with blank_modules():
        return StreamsNetwork(config, encoders), dtype


def compile_network(network: PolicyNetwork) -> None:
    """Have its nets compiled at their first use. Raises ConfigError where there is no C++ compiler."""
    compiler = os.environ.get("CXX") or "g++"
    if shutil.which(compiler) is None:
        raise ConfigError(f"compile: true needs the C++ compiler {compiler}: install it, or leave compile out")
    network.compile_parts()


def has_fast_bfloat16() -> bool:
    """Whether this CPU multiplies in bfloat16: twice as fast, and weights take half the memory."""
    capabilities = torch.cpu.get_capabilities()
    return bool(capabilities.get("avx512_bf16") or capabilities.get("amx_bf16") or capabilities.get("amx_tile"))


def _as(tensor: Tensor, dtype: torch.dtype) -> Tensor:
    return tensor.to(dtype) if tensor.is_floating_point() else tensor
