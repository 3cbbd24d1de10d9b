"""Reader of the goal: token embeddings to the vectors that say what to pick and where to place."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cliport_policy.settings import GOAL_HEADS


class GoalReader(nn.Module):
    """Small transformer layer over frozen token embeddings, then attention pooling with learned queries.

    Attention over tokens keeps which colour belongs to which object, which a pooled sentence vector loses.
    """

    def __init__(self, token_dim: int, goal_dim: int, heads: int = GOAL_HEADS, n_goals: int = 2) -> None:
        super().__init__()
        self.project = nn.Sequential(nn.LayerNorm(token_dim), nn.Linear(token_dim, goal_dim))
        self.mix = nn.TransformerEncoderLayer(
            goal_dim, heads, 2 * goal_dim, dropout=0.1, activation="gelu", batch_first=True, norm_first=True
        )
        self.queries = nn.Parameter(nn.init.normal_(torch.empty(n_goals, goal_dim), std=0.1))
        self.pool = nn.MultiheadAttention(goal_dim, heads, batch_first=True)
        self.out = nn.LayerNorm(goal_dim)

    def forward(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Return (B, n_goals * goal_dim) of tokens (B, T, token_dim); mask: (B, T), True at tokens."""
        return self.pool_words(self.read_words(tokens, mask), mask)

    def read_words(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Return the words in each other's light, (B, T, goal_dim), of tokens (B, T, token_dim) and mask (B, T)."""
        words: Tensor = self.mix(self.project(tokens), src_key_padding_mask=~mask)
        return words

    def pool_words(self, x: Tensor, mask: Tensor) -> Tensor:
        """Return (B, n_goals * goal_dim) of what `read_words` returned."""
        queries = self.queries.unsqueeze(0).expand(len(x), -1, -1)
        # A key_padding_mask would do as well, but makes torch import its symbolic shapes: 0.5 s and 40 MB.
        padding = ~mask[:, None].expand(-1, queries.shape[1], -1).repeat_interleave(self.pool.num_heads, dim=0)
        pooled, _ = self.pool(queries, x, x, attn_mask=padding, need_weights=False)
        return self.out(pooled).flatten(1)
