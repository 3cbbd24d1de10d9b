"""Locator: a score for every cell of the observation to pick at, and one for the null action."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from cliport_policy.networks.compact.unet import FilmUNet


class Locator(nn.Module):
    """U-Net to one score a cell, and a constant score of the null action ("nothing remains to be done").

    Both compete in one softmax, so that a cell's score is absolute: is there something to pick here?
    """

    def __init__(self, channels_in: int, widths: tuple[int, ...], goal_dim: int) -> None:
        super().__init__()
        self.unet = FilmUNet(channels_in, widths, goal_dim)
        self.head = nn.Conv2d(widths[0], 1, 1)
        self.null_score = nn.Parameter(torch.tensor(4.0))

    def forward(self, x: Tensor, goal: Tensor) -> Tensor:
        """Return logits (B, H/2 * W/2 + 1), the last one the null action's.

        x: (B, C, H, W). goal: (B, G).
        """
        cells = self.head(self.unet(x, goal)).flatten(1)  # (B, H/2 * W/2)
        return torch.cat((cells, self.null_score.expand(len(x), 1).to(cells.dtype)), dim=1)
