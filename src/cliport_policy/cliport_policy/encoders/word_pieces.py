"""Tokenizer from sentences to BERT's token numbers, by the tokenizer's own file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from cliport_policy.errors import EncoderError


class Tokens(NamedTuple):
    """Token numbers of a batch of sentences, padded to the longest.

    numbers: (B, T). mask: (B, T), True at tokens, False at padding.
    """

    numbers: Tensor
    mask: Tensor


class WordPieces:
    """Splitter into BERT's lower-case word pieces between [CLS] and [SEP]; pieces beyond max_tokens are cut."""

    def __init__(self, folder: Path, max_tokens: int) -> None:
        """Read tokenizer.json or vocab.txt.

        Raises:
            EncoderError: if the folder holds neither.
        """
        from tokenizers import BertWordPieceTokenizer, Tokenizer

        file, vocabulary = folder / "tokenizer.json", folder / "vocab.txt"
        try:
            if file.is_file() or not vocabulary.is_file():
                self._tokenizer = Tokenizer.from_file(str(file))
            else:
                self._tokenizer = BertWordPieceTokenizer(str(vocabulary), lowercase=True)
            self._tokenizer.enable_truncation(max_tokens)
            self._tokenizer.enable_padding()  # BERT's padding: number 0
        except Exception as error:  # the tokenizers package raises no narrower one
            reason = " ".join(str(error).split())[:120]
            raise EncoderError(f"{folder} holds no tokenizer ({reason}): give it tokenizer.json or vocab.txt") from None

    def within(self, sentence: str, first: int, end: int) -> Tensor:
        """Return which tokens (T,) of a sentence lie among its characters from `first` up to `end`."""
        offsets = self._tokenizer.encode(sentence).offsets
        return torch.tensor([first <= a < b <= end for a, b in offsets])

    def number(self, piece: str) -> int:
        """Return the number of a word piece.

        Raises:
            EncoderError: if the vocabulary lacks it.
        """
        found = self._tokenizer.token_to_id(piece)
        if found is None:
            raise EncoderError(f"the tokenizer knows no piece '{piece}'")
        return int(found)

    def __call__(self, sentences: Sequence[str]) -> Tokens:
        """Return the token numbers of sentences."""
        found = self._tokenizer.encode_batch(list(sentences))
        return Tokens(
            torch.tensor([one.ids for one in found]), torch.tensor([one.attention_mask for one in found]).bool()
        )
