"""Network that reads which kinds a sentence names, and which of its colours belong to what is picked or placed at."""

from __future__ import annotations

from enum import IntEnum

import torch
from torch import Tensor, nn

from cliport_policy.settings import TOKEN_DIM

_DIM = 128
_HEADS = 4
_DROPOUT = 0.1


class Role(IntEnum):
    """Thing that a colour in a sentence belongs to."""

    PICK = 0
    PLACE = 1
    NEITHER = 2


class SentenceNet(nn.Module):
    """One layer of attention among a sentence's frozen token embeddings, and two questions to them."""

    def __init__(self, n_kinds: int) -> None:
        """Make random weights; the last of n_kinds + 1 outputs stands for a kind that is not known."""
        super().__init__()
        self.project = nn.Sequential(nn.LayerNorm(TOKEN_DIM), nn.Linear(TOKEN_DIM, _DIM))
        self.layer = nn.TransformerEncoderLayer(_DIM, _HEADS, 2 * _DIM, _DROPOUT, batch_first=True, norm_first=True)
        self.questions = nn.Parameter(torch.empty(2, _DIM))
        nn.init.normal_(self.questions, std=0.1)
        self.attention = nn.MultiheadAttention(_DIM, _HEADS, batch_first=True)
        self.kind = nn.Linear(_DIM, n_kinds + 1)
        self.role = nn.Linear(_DIM, len(Role))

    def forward(self, tokens: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits of kinds (B, 2, n_kinds + 1), for pick and place, and of each token's role (B, T, 3).

        tokens: (B, T, 384). mask: (B, T), True at a token.
        """
        words = self.layer(self.project(tokens), src_key_padding_mask=~mask)
        questions = self.questions.expand(len(tokens), -1, -1)
        answers, _ = self.attention(questions, words, words, key_padding_mask=~mask, need_weights=False)
        return self.kind(answers + questions), self.role(words)
