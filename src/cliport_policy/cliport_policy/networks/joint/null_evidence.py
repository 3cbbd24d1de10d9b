"""What speaks for doing nothing, sought near the cells that picks and places are found at."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cliport_policy.networks.compact.unet import Downsample, FilmResidualBlock
from cliport_policy.networks.joint.trunk import pooled

_WIDTH = 32  # channels at 1/4 of the heightmap's resolution


class NullEvidence(nn.Module):
    """Small CNN on both decoders' features, whose strongest cells give each null action a part of its logit.

    A block outside its zone, or a bowl of the named colour, is a matter of a few cells, which a vector of the whole
    scene at 1/16 hardly shows. It says nothing before it is trained.
    """

    def __init__(self, channels_in: int, goal_dim: int, outputs: int, hidden: int) -> None:
        super().__init__()
        self.down = Downsample(channels_in, _WIDTH)
        self.block = FilmResidualBlock(_WIDTH, goal_dim)
        width = 2 * _WIDTH + goal_dim
        self.head = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, hidden), nn.GELU())
        self.out = nn.Linear(hidden, outputs)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, features: Tensor, goal: Tensor) -> Tensor:
        """Return logits (B, outputs) of features (B, channels_in, H/2, W/2) and goal (B, G)."""
        found = pooled((self.block(self.down(features), goal),))
        logits: Tensor = self.out(self.head(torch.cat((found.to(goal.dtype), goal), dim=1)))
        return logits
