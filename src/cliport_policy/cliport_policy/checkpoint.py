"""Checkpoints on disk: safetensors beside a JSON card that says what made them. No pickle, no half-written file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from cliport_policy.card import Card, load_card
from cliport_policy.errors import CheckpointError
from cliport_policy.whole_files import json_text, whole_file

_HALVES = (torch.float16, torch.bfloat16)
ANCHORS = "instruction_anchors"  # tensor of training sentences, compared with new ones
PRESENCE = "presence."  # prefix of the tensors of a presence network, which is none of the policy's own


def network_tensors(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the tensors of a checkpoint that are its policy network's weights."""
    return {name: tensors[name] for name in tensors if name != ANCHORS and not name.startswith(PRESENCE)}


def halved(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return tensors as they are shipped: numbers with fractions in half precision."""
    values = tensors.items()
    return {name: value.half().contiguous() if value.is_floating_point() else value for name, value in values}


def save_checkpoint(path: Path, tensors: dict[str, Tensor], card: Card) -> None:
    """Write weights and card; each file appears whole or not at all, the weights first.

    Raises:
        CheckpointError: if they can't be written.
    """
    with whole_file(path.with_suffix(".json")) as temporary_card, whole_file(path) as temporary:
        save_file({name: tensor.detach().contiguous() for name, tensor in tensors.items()}, temporary)
        temporary_card.write_text(json_text(card.to_dict()))


class StoredTensors(Mapping[str, Tensor]):
    """Mapping of a file's tensors, each read on access, so that only one of a large file need be in memory.

    Weights that were stored in half precision come in float32, as networks are built.

    The file stays open: all tensors are of the file that was there at first, also when a training replaces it.
    """

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            OSError, SafetensorError: if it is absent or damaged.
        """
        self._file = safe_open(path, "pt")
        self._names = list(self._file.keys())

    def __getitem__(self, name: str) -> Tensor:
        if name not in self._names:
            raise KeyError(name)
        tensor: Tensor = self._file.get_tensor(name)
        return tensor.float() if tensor.dtype in _HALVES else tensor

    def as_stored(self, name: str) -> Tensor:
        """Return a tensor in the precision that it was stored in."""
        tensor: Tensor = self._file.get_tensor(name)
        return tensor

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def load_checkpoint(path: Path) -> tuple[StoredTensors, Card]:
    """Read weights and card of a file written by save_checkpoint.

    Raises:
        CheckpointError: if either is absent or unusable.
    """
    card = load_card(path)
    try:
        return StoredTensors(path), card
    except (OSError, SafetensorError, ValueError) as error:
        raise CheckpointError(f"checkpoint {path} is damaged ({error}): restore it or train again") from error
