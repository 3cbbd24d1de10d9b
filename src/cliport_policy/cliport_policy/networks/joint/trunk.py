"""Encoder that picks and places share, and the decoder that each has of its own."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.compact.unet import Downsample, FilmResidualBlock
from cliport_policy.networks.joint.context import Context


class Encoder(nn.Module):
    """Features at 1/2, 1/4, ... of an image's resolution; the coarsest ones attend to each other and to the words.

    The finest level is only a stem: what things are is found at 1/4 and below, for a fraction of the work.
    """

    def __init__(self, channels_in: int, widths: tuple[int, ...], goal_dim: int, word_dim: int, layers: int) -> None:
        super().__init__()
        self.stem = nn.Conv2d(channels_in, widths[0], 3, padding=1, bias=False)
        self.stem_norm = nn.BatchNorm2d(widths[0])
        self.down = nn.ModuleList(Downsample(a, b) for a, b in pairwise(widths))
        self.blocks = nn.ModuleList(FilmResidualBlock(width, goal_dim) for width in widths[1:])
        self.context = Context(widths[-1], word_dim, layers) if layers else None

    def forward(self, x: Tensor, goal: Tensor, words: Tensor, mask: Tensor) -> tuple[Tensor, ...]:
        """Return the levels' features, fine to coarse.

        x: (B, channels_in, H/2, W/2). goal: (B, G). words: (B, T, W). mask: (B, T).
        """
        levels = [F.relu_(self.stem_norm(self.stem(x)))]
        for down, block in zip(self.down, self.blocks, strict=True):
            levels.append(block(down(levels[-1]), goal))
        if self.context is not None:
            levels[-1] = self.context(levels[-1], words, mask)
        return tuple(levels)


class Decoder(nn.Module):
    """Features at the finest level from all of an encoder's."""

    def __init__(self, widths: tuple[int, ...], width: int, goal_dim: int) -> None:
        super().__init__()
        outs = (width, *widths[1:-1])  # of each level but the coarsest
        coarser = (*widths[1:-1], widths[-1])
        self.lateral = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in zip(outs, coarser, strict=True))
        self.skip = nn.Identity() if width == widths[0] else nn.Conv2d(widths[0], width, 1)
        self.blocks = nn.ModuleList(FilmResidualBlock(a, goal_dim) for a in outs)

    def forward(self, levels: tuple[Tensor, ...], goal: Tensor) -> Tensor:
        """Return features (B, width, H/2, W/2)."""
        x = levels[-1]
        for level in reversed(range(len(levels) - 1)):
            skip = levels[level] if level else self.skip(levels[0])
            x = F.interpolate(self.lateral[level](x), size=skip.shape[-2:], mode="bilinear", align_corners=False)
            x = self.blocks[level](x + skip, goal)
        return x


def pooled(levels: tuple[Tensor, ...]) -> Tensor:
    """Return the mean and the maximum of the coarsest features: (B, 2 C)."""
    x = levels[-1]
    return torch.cat((x.mean((2, 3)), x.amax((2, 3))), dim=1)
