"""Sentences whose colours are read apart from the rest: by their names, each in the same context."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor

from cliport_policy.data.color_names import color_spans, terms_told
from cliport_policy.language import CACHE_SIZE, TextEncoder, padded, shared_encoder

_SAME = "colored"  # the word that stands for each piece of a colour's name
_BEFORE, _AFTER = "the ", " block"  # the context of a name


class NamedColors(NamedTuple):
    """Frozen embeddings of a batch of sentences, padded with 0 to the longest.

    rest: (B, T, 384), of the sentences with one and the same word wherever a colour is named. names: (B, T, 384), of
    the pieces of the colours' names in a context of their own, 0 at all other words. mask: (B, T), True at a token.
    """

    rest: Tensor
    names: Tensor
    mask: Tensor


class ColorNameReader:
    """Reader of sentences with an encoder; it finds the names of the survey, longest ones first."""

    def __init__(self, encoder: TextEncoder) -> None:
        self._encoder = encoder
        self._same = encoder.pieces.number(_SAME)
        self._read = lru_cache(CACHE_SIZE)(self._read_one)
        self.name_tokens = lru_cache(CACHE_SIZE)(self._name_tokens)

    def read(self, sentences: Sequence[str]) -> NamedColors:
        """Return the embeddings of sentences; each is encoded once and remembered."""
        rest, names = zip(*(self._read(sentence) for sentence in sentences), strict=True)
        tokens, mask = padded(rest)
        return NamedColors(tokens, padded(names).tokens, mask)

    @torch.inference_mode()
    def _read_one(self, sentence: str) -> tuple[Tensor, Tensor]:
        """Return `rest` and `names` (T, 384) of a sentence."""
        numbers, mask = self._encoder.pieces([sentence])
        found = [(a, b, self._encoder.pieces.within(sentence, a, b)) for a, b in color_spans(sentence)]
        for _, _, inside in found:
            numbers[0, inside] = self._same
        rest = self._encoder.model.states(numbers, mask)[0]
        names = torch.zeros_like(rest)
        for a, b, inside in found:
            names[inside] = self.name_tokens(sentence[a:b].lower())[: int(inside.sum())]  # a long sentence was cut
        return rest.clone(), names

    def _name_tokens(self, name: str) -> Tensor:
        """Return the embeddings (N, 384) of a name's pieces."""
        first = 1 + self._encoder.count_tokens(_BEFORE)
        end = first + self._encoder.count_tokens(name)
        return self._encoder.encode([_BEFORE + name + _AFTER]).tokens[0][first:end]


def with_colors_alike(sentence: str) -> str:
    """Return a sentence with one and the same word in place of each colour's name."""
    for start, end in reversed(color_spans(sentence)):
        sentence = sentence[:start] + _SAME + sentence[end:]
    return sentence


@lru_cache(maxsize=1)
def color_name_reader() -> ColorNameReader:
    """Return the process's one reader, over the shared encoder."""
    return ColorNameReader(shared_encoder())


@lru_cache(maxsize=2)
def basic_tokens(arm: str) -> Tensor:
    """Return the embeddings (N, 384) of the basic colour terms whose colours an arm is told."""
    return torch.cat([color_name_reader().name_tokens(term) for term in terms_told(arm)]).clone()
