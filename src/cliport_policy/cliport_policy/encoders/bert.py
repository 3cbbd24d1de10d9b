"""Sentences as the mean of a BERT's token states: MiniLM from its package, DistilBERT from files or untrained."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from torch import Tensor

from cliport_policy.encoders.bert_modules import Bert, BertShape, load_bert, untrained_bert
from cliport_policy.encoders.word_pieces import WordPieces
from cliport_policy.language import MAX_TOKENS, model_folder, shared_encoder


class Reader(NamedTuple):
    """The module, and what takes sentences to (B, dim) float32."""

    module: Bert
    read: Callable[[list[str]], Tensor]

    @property
    def dim(self) -> int:
        return self.module.dim


def minilm() -> Reader:
    """The process's one MiniLM, which also checks instructions."""
    encoder = shared_encoder()

    def read(sentences: list[str]) -> Tensor:
        tokens, mask = encoder.encode(sentences)
        return mean_state(tokens, mask)

    return Reader(encoder.model, read)


def distilbert(folder: Path) -> Reader:
    """From the files that transformers saves. Raises EncoderError where the folder holds anything else."""
    return _reader(WordPieces(folder, MAX_TOKENS), load_bert(folder))


def untrained_distilbert(seed: int) -> Reader:
    """Random weights behind the pretrained tokenizer: MiniLM's, which has the same vocabulary of 30 522 words."""
    return _reader(WordPieces(model_folder(), MAX_TOKENS), untrained_bert(BertShape(), seed))


def mean_state(tokens: Tensor, mask: Tensor) -> Tensor:
    """(B, T, D), (B, T) bool -> (B, D), not normalised."""
    weight = mask.unsqueeze(-1).to(tokens.dtype)
    return (tokens * weight).sum(1) / weight.sum(1)


def _reader(pieces: WordPieces, model: Bert) -> Reader:
    def read(sentences: list[str]) -> Tensor:
        numbers, mask = pieces(sentences)
        return mean_state(model.states(numbers, mask), mask)

    return Reader(model, read)
