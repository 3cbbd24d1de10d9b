"""Names of trained networks that promise no more than was trained: encoders that were replaced, a yaw that is fixed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from cliport_policy.card import Card
from cliport_policy.joint_config import JointConfig
from cliport_policy.named_configs import AnyNetworkConfig, config_names, load_network_config
from cliport_policy.stream_config import StreamsConfig

SURVEYED = "surveyed"
_ENCODERS = {
    "clip_rn50": "CLIP",
    "resnet50_distilbert": "ResNet50+DistilBERT",
    "efficientnet_minilm": "EfficientNet-Lite0+MiniLM",
    "untrained_resnet50_distilbert": "untrained",
    "none": "no encoder",
}
# On other encoders than its own this network is the other one: their nets are the same.
_SAME_NETS = {"rn50_bert": "cliport", "rn50_bert_rotator": "cliport_rotator"}


def method_name(name: str, network: AnyNetworkConfig) -> str:
    """Return what tables call a network that was made from the config `name` and runs as `network`.

    `cliport_rotator[EfficientNet-Lite0+MiniLM]` has other frozen encoders than its config asks for,
    `transporter[yaw 0]` has no rotator, `multi[open]` was told all colour names of the survey and, where its card says
    `reads_shapes`, what named shapes look like, `multi[strict]` the names without the unseen words, and
    `compact[changed]` is not what the shipped config of that name says.
    """
    remarks = []
    if replaced := replaced_encoders(name, network):
        remarks.append(replaced)
        name = _SAME_NETS.get(name, name)
    if isinstance(network, StreamsConfig) and network.rotator is None:
        remarks.append("yaw 0")
    if isinstance(network, JointConfig) and network.color_words != "none":
        remarks.append(network.color_words)
    if _is_changed(name, network):
        remarks.append("changed")
    return name + (f"[{', '.join(remarks)}]" if remarks else "")


def replaced_encoders(name: str, network: AnyNetworkConfig) -> str:
    """Return the encoders of a network where a shipped config of that name asks for others, "" where it does not."""
    if not isinstance(network, StreamsConfig) or name not in config_names():
        return ""
    meant = load_network_config(name)
    same = isinstance(meant, StreamsConfig) and meant.encoder == network.encoder
    return "" if same else _ENCODERS[network.encoder]


def card_method(card: Card) -> str:
    """Return what tables call the network of a checkpoint."""
    return method_name(config_name(card), card.network)


def config_name(card: Card) -> str:
    """Return the config that a checkpoint, or the one that its training began with, was made from.

    Cards of earlier versions do not say: then it is the shipped config of the same nets, or the network's kind.
    """
    made_by: Mapping[str, Any] = card.made_by
    while not made_by.get("config") and isinstance(made_by.get("init"), dict):
        made_by = made_by["init"].get("made_by", {})
    named = str(made_by.get("config", ""))
    return named or _config_like(card.network)


def met_surveyed_colors(card: Card) -> bool:
    """Return True if the checkpoint, or one that it began with, learned colours that no demonstration names.

    Such a policy has met the words of colours that the benchmark calls unseen.
    """
    made_by: Any = card.made_by
    while isinstance(made_by, dict):
        if made_by.get("train", {}).get("recolor") == SURVEYED:
            return True
        made_by = made_by.get("init", {}).get("made_by")
    return False


def _config_like(network: AnyNetworkConfig) -> str:
    alike = [name for name in config_names() if not _is_changed(name, network)]
    own = [name for name in alike if not replaced_encoders(name, network)]
    kind = str(network.to_dict().get("kind", "compact"))
    return next(iter(own or alike), kind)


def _is_changed(name: str, network: AnyNetworkConfig) -> bool:
    """Whether a shipped config of that name says other things, its encoders and its rotator apart."""
    if name not in config_names():
        return False
    meant = load_network_config(name)
    if isinstance(meant, StreamsConfig) and isinstance(network, StreamsConfig):
        meant = replace(meant.with_encoder(network.encoder), rotator=network.rotator)
        return meant != network.with_encoder(network.encoder)
    if isinstance(meant, JointConfig) and isinstance(network, JointConfig) and network.color_words != "none":
        meant = replace(meant, color_words=network.color_words)  # the arm is named by itself
    return meant != network
