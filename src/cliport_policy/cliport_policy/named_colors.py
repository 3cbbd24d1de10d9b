"""Sentences whose colours are read apart from the rest: by their names, each in the same context."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from cliport_policy.data.color_names import color_spans, shade_told, terms_told
from cliport_policy.language import CACHE_SIZE, TextEncoder, padded, shared_encoder
from cliport_policy.networks.joint.color_words import scaled_lab

_SAME = "colored"  # the word that stands for each piece of a colour's name
_BEFORE, _AFTER = "the ", " block"  # the context of a name


class NamedColors(NamedTuple):
    """Frozen embeddings of a batch of sentences, padded with 0 to the longest.

    rest: (B, T, 384), of the sentences with one and the same word wherever a colour is named. names: (B, T, 384), of
    the pieces of the colours' names in a context of their own, 0 at all other words. shades: (B, T, 3), the scaled
    CIELAB colour of a name that an arm is told and that is no basic term, at the one word that stands for it; NaN
    elsewhere. mask: (B, T), True at a token.
    """

    rest: Tensor
    names: Tensor
    shades: Tensor
    mask: Tensor


class ColorNameReader:
    """Reader of sentences with an encoder; it finds the names of the survey, longest ones first."""

    def __init__(self, encoder: TextEncoder) -> None:
        self._encoder = encoder
        self._same = encoder.pieces.number(_SAME)
        self._read = lru_cache(CACHE_SIZE)(self._read_one)
        self.name_tokens = lru_cache(CACHE_SIZE)(self._name_tokens)

    def read(self, sentences: Sequence[str], arm: str) -> NamedColors:
        """Return the embeddings of sentences, for a network of an arm; each is encoded once and remembered."""
        rest, names, shades = zip(*(self._read(sentence, arm) for sentence in sentences), strict=True)
        tokens, mask = padded(rest)
        return NamedColors(tokens, padded(names).tokens, pad_sequence(shades, True, torch.nan), mask)

    @torch.inference_mode()
    def _read_one(self, sentence: str, arm: str) -> tuple[Tensor, Tensor, Tensor]:
        """Return `rest` and `names` (T, 384) and `shades` (T, 3) of a sentence."""
        sentence, told = _with_told_alike(sentence, arm)
        numbers, mask = self._encoder.pieces([sentence])
        found = [(a, b, self._encoder.pieces.within(sentence, a, b)) for a, b in color_spans(sentence) if a not in told]
        for _, _, inside in found:
            numbers[0, inside] = self._same
        rest = self._encoder.model.states(numbers, mask)[0]
        names, shades = torch.zeros_like(rest), torch.full((len(rest), 3), torch.nan)
        for a, b, inside in found:
            names[inside] = self.name_tokens(sentence[a:b].lower())[: int(inside.sum())]  # a long sentence was cut
        for a, color in told.items():
            shades[self._encoder.pieces.within(sentence, a, a + len(_SAME))] = scaled_lab(torch.tensor(color))
        return rest.clone(), names, shades

    def _name_tokens(self, name: str) -> Tensor:
        """Return the embeddings (N, 384) of a name's pieces."""
        first = 1 + self._encoder.count_tokens(_BEFORE)
        end = first + self._encoder.count_tokens(name)
        return self._encoder.encode([_BEFORE + name + _AFTER]).tokens[0][first:end]


def _with_told_alike(sentence: str, arm: str) -> tuple[str, dict[int, tuple[float, float, float]]]:
    """Return a sentence with one and the same word for each name that an arm is told the colour of, but basic terms.

    Also the colours, RGB 0..1, by where their names' words begin.
    """
    text, told, behind = "", {}, 0
    for start, end in color_spans(sentence):
        color = shade_told(sentence[start:end].lower(), arm)
        if color is not None:
            text += sentence[behind:start]
            told[len(text)] = color
            text, behind = text + _SAME, end
    return text + sentence[behind:], told


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
