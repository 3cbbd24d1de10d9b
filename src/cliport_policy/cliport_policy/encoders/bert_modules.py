"""BERT and DistilBERT up to their last token states, on torch alone, from the files that transformers saves.

transformers has them, too, but its import takes seconds and 200 MB; the tests hold these against it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.blank import blank_modules
from cliport_policy.encoders.files import read_state_dict
from cliport_policy.errors import EncoderError

_EPSILON = 1e-12
_INITIAL_STD = 0.02
_TYPES = "embeddings.token_type_embeddings.weight"
_KEYS = {  # field of BertShape -> its keys in the configs of BERT and of DistilBERT
    "vocabulary": ("vocab_size", "vocab_size"),
    "positions": ("max_position_embeddings", "max_position_embeddings"),
    "width": ("hidden_size", "dim"),
    "hidden": ("intermediate_size", "hidden_dim"),
    "layers": ("num_hidden_layers", "n_layers"),
    "heads": ("num_attention_heads", "n_heads"),
}
_NAMES = (  # pattern of a published module's name -> the name here
    (r"^(bert|distilbert)\.", ""),
    (r"^embeddings\.(word|position)_embeddings\.", r"\1s."),
    (r"^embeddings\.LayerNorm\.", "norm."),
    (r"^(encoder|transformer)\.layer\.", "layers."),
    (r"\.attention\.(self\.query|q_lin)\.", ".query."),
    (r"\.attention\.(self\.key|k_lin)\.", ".key."),
    (r"\.attention\.(self\.value|v_lin)\.", ".value."),
    (r"\.attention\.(output\.dense|out_lin)\.", ".join."),
    (r"\.(attention\.output\.LayerNorm|sa_layer_norm)\.", ".norm1."),
    (r"\.(intermediate\.dense|ffn\.lin1)\.", ".widen."),
    (r"\.(output\.dense|ffn\.lin2)\.", ".narrow."),
    (r"\.(output\.LayerNorm|output_layer_norm)\.", ".norm2."),
)


@dataclass(frozen=True)
class BertShape:
    """Sizes of a BERT; the defaults are those of distilbert-base-uncased."""

    vocabulary: int = 30_522
    positions: int = 512
    width: int = 768
    hidden: int = 3072
    layers: int = 6
    heads: int = 12


class _Layer(nn.Module):
    """Self-attention and a perceptron, each added to its input and normalised."""

    def __init__(self, shape: BertShape) -> None:
        super().__init__()
        width = shape.width
        self.heads = shape.heads
        self.query, self.key, self.value, self.join = (nn.Linear(width, width) for _ in range(4))
        self.widen, self.narrow = nn.Linear(width, shape.hidden), nn.Linear(shape.hidden, width)
        self.norm1, self.norm2 = nn.LayerNorm(width, _EPSILON), nn.LayerNorm(width, _EPSILON)

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        """Return (B, T, width) of x (B, T, width) and a mask (B, 1, 1, T), True at tokens."""
        query, key, value = (
            part(x).unflatten(-1, (self.heads, -1)).transpose(1, 2) for part in (self.query, self.key, self.value)
        )
        seen = F.scaled_dot_product_attention(query, key, value, mask)  # (B, heads, T, width / heads)
        x = self.norm1(x + self.join(seen.transpose(1, 2).flatten(2)))
        return self.norm2(x + self.narrow(F.gelu(self.widen(x))))


class Bert(nn.Module):
    """BERT from token numbers to token states."""

    def __init__(self, shape: BertShape) -> None:
        super().__init__()
        self.dim = shape.width
        self.words = nn.Embedding(shape.vocabulary, shape.width)
        self.positions = nn.Embedding(shape.positions, shape.width)  # plus the embedding of the first token type
        self.norm = nn.LayerNorm(shape.width, _EPSILON)
        self.layers = nn.ModuleList(_Layer(shape) for _ in range(shape.layers))

    def forward(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Return the states (B, T, dim) of token numbers (B, T); mask: (B, T), True at tokens, False at padding."""
        x = self.norm(self.words(tokens) + self.positions.weight[: tokens.shape[1]])
        for layer in self.layers:
            x = layer(x, mask[:, None, None])
        return x

    def states(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Return what `forward` does, in float32 whatever the weights are."""
        states: Tensor = self(tokens, mask)
        return states.float()


def load_bert(folder: Path) -> Bert:
    """Load config.json and model.safetensors or pytorch_model.bin of a folder.

    Raises:
        EncoderError: if they are absent or unusable.
    """
    try:
        shape = _shape(json.loads((folder / "config.json").read_text(encoding="utf-8")))
        weights = _weights(folder)
        with blank_modules():
            network = Bert(shape)
        network.load_state_dict({name: weights[name] for name in network.state_dict()}, assign=True)
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise EncoderError(
            f"{folder} holds no BERT ({' '.join(reason.split())[:120]}): it needs config.json and model.safetensors"
        ) from None
    return network.eval().requires_grad_(False)


def untrained_bert(shape: BertShape, seed: int) -> Bert:
    """Make a BERT of random weights, drawn as its authors do."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = Bert(shape)
        for module in network.modules():
            if isinstance(module, nn.Linear | nn.Embedding):
                nn.init.normal_(module.weight, std=_INITIAL_STD)
            if isinstance(module, nn.Linear):
                nn.init.zeros_(module.bias)
    return network.eval().requires_grad_(False)


def _shape(config: Mapping[str, Any]) -> BertShape:
    distilled = config.get("model_type") == "distilbert"
    return BertShape(**{field: int(config[names[distilled]]) for field, names in _KEYS.items()})


def _weights(folder: Path) -> dict[str, Tensor]:
    file = folder / "model.safetensors"
    raw = load_file(file) if file.is_file() else read_state_dict(folder / "pytorch_model.bin")
    named = {_module_name(name): value for name, value in raw.items()}
    if _TYPES in named:
        named["positions.weight"] = named["positions.weight"] + named[_TYPES][0]
    return named


def _module_name(name: str) -> str:
    for theirs, ours in _NAMES:
        name = re.sub(theirs, ours, name)
    return name
