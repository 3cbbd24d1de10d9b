"""Trained networks without some of their parts, to see what each gives."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from cliport_policy.card import Card
from cliport_policy.errors import ConfigError
from cliport_policy.joint_config import JointConfig
from cliport_policy.named_configs import AnyNetworkConfig

if TYPE_CHECKING:
    from torch import Tensor

_ALIGNER = "aligner"
PARTS = (_ALIGNER, "compares_colors", "fits_prints", "reads_kinds", "reads_shapes", "reads_sides", "sweeps_things")


def without_parts(network: AnyNetworkConfig, parts: Collection[str]) -> AnyNetworkConfig:
    """Return the configuration of a network that lacks some of PARTS.

    Raises:
        ConfigError: for what is none of them, or is not part of the network.
    """
    for part in parts:
        if part not in PARTS:
            raise ConfigError(f"{part!r} is no part that can be left out: name some of {', '.join(PARTS)}")
        if not isinstance(network, JointConfig) or not getattr(network, part):
            raise ConfigError(f"this network has no {part} to leave out")
        network = JointConfig(**asdict(network) | {part: False})
    return network


def leave_out(parts: Collection[str], tensors: Mapping[str, Tensor], card: Card) -> tuple[Mapping[str, Tensor], Card]:
    """Return the tensors and the card of a checkpoint without some of PARTS.

    Raises:
        ConfigError: for what is none of them, or is not part of its network.
    """
    if _ALIGNER in parts:
        tensors = {name: tensors[name] for name in tensors if not name.startswith(f"{_ALIGNER}.")}
    return tensors, replace(card, network=without_parts(card.network, parts))
