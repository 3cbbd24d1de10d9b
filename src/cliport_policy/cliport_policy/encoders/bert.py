"""Sentences as the mean of a BERT's token states: MiniLM from its package, DistilBERT from files or untrained."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from torch import Tensor

from cliport_policy.encoders.bert_modules import Bert, BertShape, load_bert, untrained_bert
from cliport_policy.encoders.word_pieces import WordPieces
from cliport_policy.language import MAX_TOKENS, model_folder, shared_encoder


class SentenceEncoder(NamedTuple):
    """Encoder of sentences as one vector each.

    encode: takes sentences to (B, dim) float32. module: the network behind it.
    """

    module: Bert
    encode: Callable[[list[str]], Tensor]

    @property
    def dim(self) -> int:
        """Width of a sentence's vector."""
        return self.module.dim


def minilm() -> SentenceEncoder:
    """Return the process's one MiniLM, which also checks instructions."""
    encoder = shared_encoder()

    def encode(sentences: list[str]) -> Tensor:
        tokens, mask = encoder.encode(sentences)
        return mean_state(tokens, mask)

    return SentenceEncoder(encoder.model, encode)


def distilbert(folder: Path) -> SentenceEncoder:
    """Load the files that transformers saves.

    Raises:
        EncoderError: if the folder holds anything else.
    """
    return _sentence_encoder(WordPieces(folder, MAX_TOKENS), load_bert(folder))


def untrained_distilbert(seed: int) -> SentenceEncoder:
    """Make a DistilBERT of random weights behind a pretrained tokenizer.

    It is MiniLM's tokenizer, which has the same vocabulary of 30 522 words.
    """
    return _sentence_encoder(WordPieces(model_folder(), MAX_TOKENS), untrained_bert(BertShape(), seed))


def mean_state(tokens: Tensor, mask: Tensor) -> Tensor:
    """Return the mean of token states (B, T, D) over the tokens of a mask (B, T): (B, D), not normalised."""
    weight = mask.unsqueeze(-1).to(tokens.dtype)
    return (tokens * weight).sum(1) / weight.sum(1)


def _sentence_encoder(pieces: WordPieces, model: Bert) -> SentenceEncoder:
    def encode(sentences: list[str]) -> Tensor:
        numbers, mask = pieces(sentences)
        return mean_state(model.states(numbers, mask), mask)

    return SentenceEncoder(model, encode)
