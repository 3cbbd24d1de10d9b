"""Checkpoints on disk: safetensors beside a JSON card that says what made them. No pickle, no half-written file."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor

from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.errors import CheckpointError, ConfigError
from cliport_policy.named_configs import AnyNetworkConfig, network_config_from_dict

FORMAT_VERSION = 1
SHIPPED_FOLDER = Path(__file__).parent / "weights"
DEFAULT_NAME = "compact-bowls"
ANCHORS = "instruction_anchors"  # the tensor of training sentences that new ones are compared with


@dataclass(frozen=True)
class Card:
    """What a checkpoint is: its network, its workspace, the text encoder it expects and how it came about.

    frozen: name and fingerprint of the frozen encoders that a network of streams was trained on.
    min_similarity: an instruction whose sentence vector is less similar than this to every anchor is refused.
    """

    network: AnyNetworkConfig
    workspace: WorkspaceSpec
    encoder: str
    min_similarity: float
    made_by: dict[str, Any] = field(default_factory=dict)
    scores: dict[str, Any] = field(default_factory=dict)
    frozen: str = ""

    def to_dict(self) -> dict[str, Any]:
        return {
            "version": FORMAT_VERSION,
            "network": self.network.to_dict(),
            "workspace": self.workspace.to_dict(),
            "encoder": self.encoder,
            "min_similarity": self.min_similarity,
            "made_by": self.made_by,
            "scores": self.scores,
            "frozen": self.frozen,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Card:
        return cls(
            network=network_config_from_dict(values["network"]),
            workspace=WorkspaceSpec.from_dict(values["workspace"]),
            encoder=values["encoder"],
            min_similarity=float(values["min_similarity"]),
            made_by=dict(values.get("made_by", {})),
            scores=dict(values.get("scores", {})),
            frozen=str(values.get("frozen", "")),
        )


def shipped_names() -> list[str]:
    """Names of the checkpoints that the package ships."""
    return sorted(path.stem for path in SHIPPED_FOLDER.glob("*.safetensors"))


def resolve_checkpoint(path_or_name: str | Path) -> Path:
    """The weights file of a path, of a shipped name, or of `default`.

    Raises CheckpointError, naming the shipped ones, where there is no such file.
    """
    name = str(path_or_name)
    if name == "default":
        name = DEFAULT_NAME
    shipped = SHIPPED_FOLDER / f"{name}.safetensors"
    path = shipped if shipped.is_file() else Path(name).expanduser()
    if path.is_dir():
        path = path / "policy.safetensors"
    if not path.is_file():
        raise CheckpointError(
            f"no checkpoint at '{path_or_name}': give a .safetensors file, a training folder, "
            f"or one of {['default', *shipped_names()]}"
        )
    return path


def save_checkpoint(path: Path, tensors: dict[str, Tensor], card: Card) -> None:
    """Write weights and card; each file appears whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".tmp")
    save_file({name: tensor.detach().contiguous() for name, tensor in tensors.items()}, temporary)
    write_json(path.with_suffix(".json"), card.to_dict())
    os.replace(temporary, path)


def load_checkpoint(path: Path) -> tuple[dict[str, Tensor], Card]:
    """Weights and card of a file written by save_checkpoint. Raises CheckpointError on anything unusable."""
    card_path = path.with_suffix(".json")
    if not card_path.is_file():
        raise CheckpointError(f"checkpoint {path} has no card: {card_path.name} must lie beside it")
    try:
        values = json.loads(card_path.read_text())
        if values.get("version") != FORMAT_VERSION:
            raise CheckpointError(
                f"checkpoint {path} has format {values.get('version')!r}, "
                f"this version reads {FORMAT_VERSION}: train again"
            )
        card = Card.from_dict(values)
    except CheckpointError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ConfigError) as error:
        raise CheckpointError(f"the card {card_path} is damaged ({error}): restore it or train again") from error
    except Exception as error:  # an unusable workspace: its own error type belongs to another package
        raise CheckpointError(f"the card {card_path} holds no usable workspace ({error})") from error
    try:
        return load_file(path), card
    except (OSError, SafetensorError, ValueError) as error:
        raise CheckpointError(f"checkpoint {path} is damaged ({error}): restore it or train again") from error


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Write a JSON file that appears whole or not at all."""
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_text(json.dumps(values, indent=2) + "\n")
    os.replace(temporary, path)
