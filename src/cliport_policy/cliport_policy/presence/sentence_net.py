"""Network that reads which kinds a sentence names, and which of its colours belong to what is picked or placed at."""

from __future__ import annotations

from enum import IntEnum

import torch
from torch import Tensor, nn
from torch.nn import functional as F

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
        answers = _attended(self.attention, questions, words, mask)
        return self.kind(answers + questions), self.role(words)


def _attended(attention: nn.MultiheadAttention, questions: Tensor, words: Tensor, mask: Tensor) -> Tensor:
    """Return what the module itself does (B, Q, D): its own checks import torch's compiler, which takes 100 MB."""
    assert attention.in_proj_weight is not None and attention.in_proj_bias is not None
    weights, biases = attention.in_proj_weight.chunk(3), attention.in_proj_bias.chunk(3)
    query, key, value = (
        F.linear(x, weight, bias).unflatten(-1, (_HEADS, -1)).transpose(1, 2)  # (B, N, D) -> (B, h, N, d)
        for x, weight, bias in zip((questions, words, words), weights, biases, strict=True)
    )
    mixed = F.scaled_dot_product_attention(query, key, value, attn_mask=mask[:, None, None])
    out: Tensor = attention.out_proj(mixed.transpose(1, 2).flatten(2))
    return out
