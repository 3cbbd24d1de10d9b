"""Facts about the policy that is scored: which weights, what their network is called, what it knew beforehand."""

from __future__ import annotations

from typing import Any

from cliport_benchmark.errors import OptionError
from cliport_policy.ablation import without_parts
from cliport_policy.card import Card, load_card, resolve_checkpoint, weights_sha256
from cliport_policy.method_name import card_method, config_name, met_surveyed_colors, replaced_encoders
from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.stream_config import StreamsConfig


def policy_facts(checkpoint: str, left_out: tuple[str, ...] = ()) -> dict[str, Any]:
    """Return what results say of a checkpoint beside its scores.

    left_out: parts of its network that it acts without.

    Raises:
        CheckpointError: when there is no such checkpoint, or it has no usable card.
        OptionError: when its network cannot be scored.
        ConfigError: when it has no such part.
    """
    path = resolve_checkpoint(checkpoint)
    card = load_card(path)
    check_needs_no_goal_image(checkpoint, card.network)
    without_parts(card.network, left_out)
    parts = {"left_out": list(left_out)} if left_out else {}
    return {"weights_sha256": weights_sha256(path), **method_facts(card), **parts}


def method_facts(card: Card) -> dict[str, Any]:
    """Return the method's name, its config, whether its encoders are its own, and whether it met unseen colours."""
    config = config_name(card)
    return {
        "method": card_method(card),
        "config": config,
        "own_encoders": not replaced_encoders(config, card.network),
        "met_surveyed_colors": met_surveyed_colors(card),
    }


def check_needs_no_goal_image(name: str, network: AnyNetworkConfig) -> None:
    """Raise OptionError for a network that reads an image of the goal, which no episode shows it yet."""
    if isinstance(network, StreamsConfig) and network.needs_goal_image:
        raise OptionError(
            f"{name} reads an image of the goal, which evaluate does not make: score a network that reads sentences, "
            "or call Policy.infer with a goal of your own"
        )
