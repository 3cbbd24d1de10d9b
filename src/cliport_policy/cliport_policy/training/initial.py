"""Checkpoint that a fine-tuning begins with: its weights, its config and the sentences it knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from torch import Tensor

from cliport_core.action import Primitive
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import Card, resolve_checkpoint, weights_sha256
from cliport_policy.checkpoint import ANCHORS, load_checkpoint, network_tensors
from cliport_policy.data.demonstrations import DemonstrationSet
from cliport_policy.data.primitives import check_primitive, primitive_taught
from cliport_policy.errors import CheckpointError, ConfigError, DataError
from cliport_policy.language import ENCODER_NAME
from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.policy_network import PolicyNetwork

# The choice of a fallback encoder is made when a network is built; put_into compares its result.
_SETTLED_LATER = {"encoder", "fallback_encoder"}
# Kept of an earlier training's data sets.
_OF_DATA = ("weight", "task", "split", "episodes", "command", "commit", "dirty")


@dataclass(frozen=True, eq=False)
class Initial:
    """Checkpoint as it was asked for.

    name: path or shipped name. sha256: of its weights file.
    """

    name: str
    sha256: str
    tensors: Mapping[str, Tensor]
    card: Card

    @property
    def anchors(self) -> Tensor:
        """Spread of the sentences that the checkpoint was trained on: (A, 384)."""
        return self.tensors[ANCHORS]

    def check_network(self, given: AnyNetworkConfig) -> None:
        """Raise ConfigError, naming what differs, if a config is not the checkpoint's."""
        mine, theirs = self.card.network.to_dict(), given.to_dict()
        differing = [
            f"{key} {theirs.get(key)} not {mine.get(key)}"
            for key in sorted((mine.keys() | theirs.keys()) - _SETTLED_LATER)
            if mine.get(key) != theirs.get(key)
        ]
        if differing:
            raise ConfigError(
                f"the checkpoint {self.name} is of another network ({', '.join(differing)[:200]}): "
                "leave --config and its settings out, they come from the checkpoint"
            )

    def check_workspace(self, given: WorkspaceSpec) -> None:
        """Raise DataError, naming what differs, if the data's workspace is not the checkpoint's."""
        mine, theirs = self.card.workspace.to_dict(), given.to_dict()
        differing = [f"{name} {theirs[name]} not {mine[name]}" for name in mine if mine[name] != theirs[name]]
        if differing:
            raise DataError(
                f"the data's workspace is not that of the checkpoint {self.name} ({', '.join(differing)}): "
                "make the data set with the checkpoint's workspace, or train without --init"
            )

    def check_primitive(self, sets: Sequence[DemonstrationSet]) -> None:
        """Raise DataError, in words, where a demonstration is of another primitive than the checkpoint's."""
        check_primitive(sets, self.card.primitive, self.name)

    def put_into(self, network: PolicyNetwork) -> None:
        """Give a network the weights.

        Raises:
            CheckpointError: if they do not fit it or its encoders.
        """
        if network.encoder_identity != self.card.frozen:
            raise CheckpointError(
                f"checkpoint {self.name} was trained on the encoders '{self.card.frozen}'; "
                f"here are '{network.encoder_identity}'"
            )
        try:
            network.load_state_dict(network_tensors(self.tensors))
        except RuntimeError as error:
            reason = " ".join(str(error).split())[:200]
            raise CheckpointError(f"checkpoint {self.name} does not fit its card ({reason}): restore it") from error

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for the card of a network that begins with this checkpoint."""
        return {"checkpoint": self.name, "sha256": self.sha256, "made_by": in_brief(self.card.made_by)}


def in_brief(made_by: dict[str, Any]) -> dict[str, Any]:
    """Return what a card says of an earlier training, and of those before it, with its data sets in few words.

    Their settings are in the card of the training itself; a long chain of them would be repeated each time.
    """
    brief = dict(made_by)
    if "data" in brief:
        brief["data"] = [{name: one[name] for name in _OF_DATA if name in one} for one in brief["data"]]
    before = brief.get("init")
    if isinstance(before, dict) and isinstance(before.get("made_by"), dict):
        brief["init"] = {**before, "made_by": in_brief(before["made_by"])}
    return brief


def primitive_of(
    sets: Sequence[DemonstrationSet], network_config: AnyNetworkConfig, initial: Initial | None
) -> Primitive:
    """Return the primitive of all demonstrations; pick_place where the network chooses it.

    Raises:
        DataError: in words, where a demonstration is of another one.
    """
    if getattr(network_config, "chooses_primitive", False):
        return Primitive.PICK_PLACE
    if initial is None:
        return primitive_taught(sets)
    initial.check_primitive(sets)
    return initial.card.primitive


def load_initial(path_or_name: str | Path) -> Initial:
    """Load a checkpoint by path or shipped name.

    Raises:
        CheckpointError: if it can't be used.
    """
    path = resolve_checkpoint(path_or_name)
    tensors, card = load_checkpoint(path)
    if card.encoder != ENCODER_NAME:
        raise CheckpointError(f"checkpoint {path} needs the text encoder {card.encoder!r}; here is {ENCODER_NAME!r}")
    if ANCHORS not in tensors:
        raise CheckpointError(f"checkpoint {path} lacks {ANCHORS}: train again")
    return Initial(str(path_or_name), weights_sha256(path), tensors, card)
