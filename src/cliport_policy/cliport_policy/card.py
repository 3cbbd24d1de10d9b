"""Cards: what a checkpoint is and what made it, read without its weights, and without torch."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cliport_core.action import Primitive
from cliport_core.errors import CoreError
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.errors import CheckpointError, ConfigError
from cliport_policy.named_configs import AnyNetworkConfig, network_config_from_dict

FORMAT_VERSION = 1
SHIPPED_FOLDER = Path(__file__).parent / "weights"
DEFAULT_NAME = "multi-open-100"
CALIBRATED = ("pick", "place")
_MOST_BIAS = 20.0  # of log odds


@dataclass(frozen=True)
class Card:
    """Description of a checkpoint: its network, its workspace, its text encoder and how it came about.

    frozen: name and fingerprint of the frozen encoders that a network of streams was trained on.
    temperatures: divisors of the logits of `pick` and `place` for calibrated confidences; 1 if absent.
    done_bias: what is added to the log odds of "done" where a primitive would act, by the primitive's name, so that a
    probability of 0.5 parts what is done from what is not; 0 if absent.
    presence: `kinds`, `colors` and their `shades` that the checkpoint's presence network knows, and `made_by`; empty if
    it has none.
    primitive: the primitive of all demonstrations behind it; pick_place if the card does not say.
    min_similarity: an instruction whose sentence vector is less similar than this to every anchor is refused.
    """

    network: AnyNetworkConfig
    workspace: WorkspaceSpec
    encoder: str
    min_similarity: float
    made_by: dict[str, Any] = field(default_factory=dict)
    scores: dict[str, Any] = field(default_factory=dict)
    frozen: str = ""
    temperatures: dict[str, float] = field(default_factory=dict)
    primitive: Primitive = Primitive.PICK_PLACE
    done_bias: dict[str, float] = field(default_factory=dict)
    presence: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, value in self.temperatures.items():
            if name not in CALIBRATED or not 0 < value < math.inf:
                raise ConfigError(f"a temperature must be positive and of {' or '.join(CALIBRATED)}: {name} is {value}")
        labels = [primitive.label for primitive in Primitive]
        for name, value in self.done_bias.items():
            if name not in labels or not abs(value) <= _MOST_BIAS:
                raise ConfigError(
                    f"a done_bias must lie in ±{_MOST_BIAS:.0f} and be of {' or '.join(labels)}: {name} is {value}"
                )

    def temperature(self, name: str) -> float:
        """Return the temperature of `pick` or `place`."""
        return self.temperatures.get(name, 1.0)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return {
            "version": FORMAT_VERSION,
            "network": self.network.to_dict(),
            "workspace": self.workspace.to_dict(),
            "encoder": self.encoder,
            "min_similarity": self.min_similarity,
            "made_by": self.made_by,
            "scores": self.scores,
            "frozen": self.frozen,
            "temperatures": self.temperatures,
            "done_bias": self.done_bias,
            "presence": self.presence,
            "primitive": self.primitive.label,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Card:
        """Read the values that `to_dict` returned.

        Raises:
            KeyError, ConfigError: if a value is absent or can't be.
        """
        return cls(
            network=network_config_from_dict(values["network"]),
            workspace=WorkspaceSpec.from_dict(values["workspace"]),
            encoder=values["encoder"],
            min_similarity=float(values["min_similarity"]),
            made_by=dict(values.get("made_by", {})),
            scores=dict(values.get("scores", {})),
            frozen=str(values.get("frozen", "")),
            temperatures={name: float(value) for name, value in values.get("temperatures", {}).items()},
            primitive=Primitive.from_label(values.get("primitive", Primitive.PICK_PLACE.label)),
            done_bias={name: float(value) for name, value in values.get("done_bias", {}).items()},
            presence=dict(values.get("presence", {})),
        )


def shipped_names() -> list[str]:
    """Return the names of the checkpoints that the package ships."""
    return sorted(path.stem for path in SHIPPED_FOLDER.glob("*.safetensors"))


def resolve_checkpoint(path_or_name: str | Path) -> Path:
    """Return the weights file of a path, of a shipped name, or of `default`.

    Raises:
        CheckpointError: naming the shipped checkpoints, if there is no such file.
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


def load_card(path: Path) -> Card:
    """Read the card beside a weights file.

    Raises:
        CheckpointError: if it is absent or unusable.
    """
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
        return Card.from_dict(values)
    except CheckpointError:
        raise
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ConfigError) as error:
        raise CheckpointError(f"the card {card_path} is damaged ({error}): restore it or train again") from error
    except CoreError as error:
        words = f"the card {card_path} holds no usable workspace ({error}): restore it or train again"
        raise CheckpointError(words) from error


def weights_sha256(path: Path) -> str:
    """Return the SHA-256 of a weights file, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
