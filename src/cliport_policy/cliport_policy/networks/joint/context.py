"""Attention among an encoder's coarsest cells, and from them to the sentence's words."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.joint_config import CONTEXT_HEADS


class Attention(nn.Module):
    """Multi-head attention of queries to keys, both normalised before."""

    def __init__(self, dim: int, key_dim: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(dim)
        self.query = nn.Linear(dim, dim)
        self.key_value = nn.Linear(key_dim, 2 * dim)
        self.out = nn.Linear(dim, dim)

    def forward(self, x: Tensor, keys: Tensor | None = None, mask: Tensor | None = None) -> Tensor:
        """Return what is added to x (B, N, D).

        keys: (B, T, K), x itself if None. mask: (B, T), True where there is a key.
        """
        x = self.norm(x)
        query = self._split(self.query(x))  # (B, h, N, d)
        key, value = (self._split(part) for part in self.key_value(x if keys is None else keys).chunk(2, dim=-1))
        seen = None if mask is None else mask[:, None, None]  # (B, 1, 1, T)
        mixed = F.scaled_dot_product_attention(query, key, value, attn_mask=seen)
        out: Tensor = self.out(mixed.transpose(1, 2).flatten(2))
        return out

    def _split(self, x: Tensor) -> Tensor:
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2)  # (B, N, D) -> (B, h, N, d)


class ContextLayer(nn.Module):
    """Cells attend to each other, then to words, then each to itself."""

    def __init__(self, dim: int, word_dim: int, heads: int = CONTEXT_HEADS) -> None:
        super().__init__()
        self.cells = Attention(dim, dim, heads)
        self.words = Attention(dim, word_dim, heads)
        self.own = nn.Sequential(nn.LayerNorm(dim), nn.Linear(dim, 2 * dim), nn.GELU(), nn.Linear(2 * dim, dim))

    def forward(self, x: Tensor, words: Tensor, mask: Tensor) -> Tensor:
        """Return cells (B, N, D) of cells (B, N, D), words (B, T, W) and their mask (B, T)."""
        x = x + self.cells(x)
        x = x + self.words(x, words, mask)
        out: Tensor = x + self.own(x)
        return out


class Context(nn.Module):
    """Layers of attention over a map, whose cells are told where they are."""

    def __init__(self, dim: int, word_dim: int, layers: int) -> None:
        super().__init__()
        self.position = nn.Linear(2, dim)
        self.layers = nn.ModuleList(ContextLayer(dim, word_dim) for _ in range(layers))

    def forward(self, x: Tensor, words: Tensor, mask: Tensor) -> Tensor:
        """Return a map (B, C, H, W) of a map, words (B, T, W) and their mask (B, T)."""
        height, width = x.shape[-2:]
        rows, cols = (torch.linspace(-1, 1, n, device=x.device) for n in (height, width))
        at = torch.stack(torch.meshgrid(rows, cols, indexing="ij"), dim=-1).flatten(0, 1)  # (H W, 2)
        cells = x.flatten(2).transpose(1, 2) + self.position(at)  # (B, H W, C)
        for layer in self.layers:
            cells = layer(cells, words, mask)
        return cells.transpose(1, 2).unflatten(2, (height, width)).contiguous(memory_format=torch.channels_last)
