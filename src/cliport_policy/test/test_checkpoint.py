"""Checkpoints on disk: read while they are replaced, and whole whenever writing them was stopped."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import Card, load_card
from cliport_policy.checkpoint import load_checkpoint, save_checkpoint
from cliport_policy.config import NetworkConfig
from cliport_policy.errors import CheckpointError

CARD = Card(NetworkConfig(), WorkspaceSpec(), "encoder", 0.5)


def tensors(value: float) -> dict[str, torch.Tensor]:
    return {name: torch.full((1000,), value) for name in ("a", "b")}


def test_all_tensors_are_of_the_file_that_was_opened(tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    save_checkpoint(path, tensors(1.0), CARD)
    stored, _ = load_checkpoint(path)
    first = stored["a"].clone()
    save_checkpoint(path, tensors(2.0), CARD)  # as a training does every few minutes
    assert torch.equal(first, stored["b"]) and float(stored["b"][0]) == 1.0
    assert float(load_checkpoint(path)[0]["a"][0]) == 2.0
    assert set(stored) == {"a", "b"} and "c" not in stored


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_weights_in_half_precision_come_in_float32(tmp_path: Path, dtype: torch.dtype) -> None:
    """As files that were made smaller; numbers of tokens and the like stay what they are."""
    path = tmp_path / "policy.safetensors"
    save_checkpoint(path, {"a": torch.full((9,), 0.5, dtype=dtype), "n": torch.arange(3)}, CARD)
    stored, _ = load_checkpoint(path)
    assert torch.equal(stored["a"], torch.full((9,), 0.5)) and stored["a"].dtype == torch.float32
    assert stored["n"].dtype == torch.int64


def test_the_weights_are_replaced_before_the_card(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replaced, replace = [], os.replace

    def note(source: Path, target: Path) -> None:
        replaced.append(target.name)
        replace(source, target)

    monkeypatch.setattr(os, "replace", note)
    save_checkpoint(tmp_path / "policy.safetensors", tensors(1.0), CARD)
    assert replaced == ["policy.safetensors", "policy.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["policy.json", "policy.safetensors"]


def test_what_cannot_be_written_leaves_both_files_as_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "policy.safetensors"
    save_checkpoint(path, tensors(1.0), CARD)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}

    def full(*_: object, **__: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(CheckpointError, match="what was saved before is kept"):
        save_checkpoint(path, tensors(2.0), CARD)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda card: card["workspace"].update(x_max=-9.0), "holds no usable workspace .*: restore it or train again"),
        (lambda card: card.pop("workspace"), "is damaged .*: restore it or train again"),
    ],
)
def test_an_unusable_card_names_a_remedy(change: Callable[[dict], None], words: str, tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    save_checkpoint(path, tensors(1.0), CARD)
    card = json.loads(path.with_suffix(".json").read_text())
    change(card)
    path.with_suffix(".json").write_text(json.dumps(card))
    with pytest.raises(CheckpointError, match=words):
        load_card(path)
