"""What tables call a network: never more than was trained."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import Card, load_card, resolve_checkpoint
from cliport_policy.method_name import card_method, config_name, met_surveyed_colors, method_name, replaced_encoders
from cliport_policy.named_configs import AnyNetworkConfig, load_network_config
from cliport_policy.stream_config import StreamsConfig

PACKAGED = "efficientnet_minilm"


def streams(name: str, encoder: str = "", **changes: Any) -> StreamsConfig:
    config = load_network_config(name, changes)
    assert isinstance(config, StreamsConfig)
    return config.with_encoder(encoder or config.encoder)


def card(network: AnyNetworkConfig, **made_by: Any) -> Card:
    return Card(network, WorkspaceSpec(), "all-MiniLM-L6-v2", 0.45, made_by=made_by)


@pytest.mark.parametrize(
    ("name", "network", "called"),
    [
        ("compact", load_network_config("compact"), "compact"),
        ("compact", load_network_config("compact", {"goal_dim": 64}), "compact[changed]"),
        ("multi", load_network_config("multi"), "multi[open]"),
        ("multi", load_network_config("multi", {"color_words": "strict"}), "multi[strict]"),
        ("multi", load_network_config("multi", {"gate": False}), "multi[open, changed]"),
        ("multi", load_network_config("multi", {"color_words": "none", "color_reading": "tokens"}), "multi[changed]"),
        ("multi", load_network_config("multi", {"color_reading": "tokens"}), "multi[open, changed]"),
        ("cliport_rotator", streams("cliport_rotator"), "cliport_rotator"),
        ("cliport", streams("cliport", rotator="pick"), "cliport"),
        ("transporter", streams("transporter"), "transporter[yaw 0]"),
        ("cliport_rotator", streams("cliport_rotator", PACKAGED), "cliport_rotator[EfficientNet-Lite0+MiniLM]"),
        ("rn50_bert_rotator", streams("rn50_bert_rotator"), "rn50_bert_rotator"),
        ("rn50_bert_rotator", streams("rn50_bert_rotator", PACKAGED), "cliport_rotator[EfficientNet-Lite0+MiniLM]"),
        ("rn50_bert", streams("rn50_bert", PACKAGED), "cliport[EfficientNet-Lite0+MiniLM, yaw 0]"),
        ("clip_only_rotator", streams("clip_only_rotator", width=0.5), "clip_only_rotator[changed]"),
        ("mine", streams("cliport_rotator", PACKAGED), "mine"),
    ],
)
def test_what_a_network_is_called(name: str, network: AnyNetworkConfig, called: str) -> None:
    assert method_name(name, network) == called
    assert card_method(card(network, config=name)) == called


def test_the_same_nets_have_one_name_on_packaged_encoders() -> None:
    """Why rn50_bert on other encoders may be called cliport."""
    for ending in ("", "_rotator"):
        assert streams(f"rn50_bert{ending}", PACKAGED) == streams(f"cliport{ending}", PACKAGED)
    assert not replaced_encoders("rn50_bert", streams("rn50_bert"))


def test_the_config_is_known_after_fine_tuning_and_from_old_cards() -> None:
    network = streams("clip_only_rotator")
    first = card(network, config="clip_only_rotator", train={"recolor": "surveyed"})
    tuned = card(network, config="", init={"made_by": first.made_by}, train={"recolor": "none"})
    assert config_name(tuned) == "clip_only_rotator"
    assert met_surveyed_colors(tuned) and met_surveyed_colors(first)
    assert not met_surveyed_colors(replace(tuned, made_by={"train": {"recolor": "demonstrated"}}))
    assert config_name(card(streams("rn50_bert"))) == "rn50_bert"
    shipped = load_card(resolve_checkpoint("default"))
    assert card_method(shipped) == "multi[open]" and not met_surveyed_colors(shipped)


def test_a_joint_network_of_no_shipped_config_is_called_joint() -> None:
    assert config_name(card(load_network_config("multi", {"goal_dim": 64}))) == "joint"
