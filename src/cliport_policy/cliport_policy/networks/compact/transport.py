"""Transport: the pick's features, turned by each angle, correlated with the scene's features."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.compact.unet import FilmUNet
from cliport_policy.networks.correlation import correlate_centered
from cliport_policy.networks.rotation import are_opposite_pairs, rotated_windows, window_offsets


class Transport(nn.Module):
    """Cross-correlation of a window of query features with the key features, plus a bias that the goal gives.

    The window is cut from the feature map and turned there, once an observation, instead of turning the image
    k times and running the network on each (as Transporter Networks do): the same correlation for a fraction of
    the work. Query and key are unit vectors a cell, the scores' temperature is learned.
    """

    def __init__(
        self, channels_in: int, widths: tuple[int, ...], goal_dim: int, channels: int, query_cells: int
    ) -> None:
        super().__init__()
        self.query_cells = query_cells
        self.unet = FilmUNet(channels_in, widths, goal_dim)
        self.key = nn.Conv2d(widths[0], channels, 1)
        self.query = nn.Conv2d(widths[0], channels, 1)
        self.bias = nn.Conv2d(widths[0], 1, 1)
        self.log_scale = nn.Parameter(torch.tensor(2.0))
        self.log_radius = nn.Parameter(torch.tensor(1.5))

    def forward(self, x: Tensor, goal: Tensor, pick: Tensor, angles: Tensor) -> Tensor:
        """Return logits (B, R, H/2, W/2).

        x: (B, C, H, W). goal: (B, G). pick: (B, 2) float pixel (row, col). angles: (B, R) rad relative to the pick's
        yaw.
        """
        features = self.unet(x, goal)
        key = F.normalize(self.key(features).float(), dim=1)  # (B, C, h, w)
        query = F.normalize(self.query(features).float(), dim=1)
        half_turns = are_opposite_pairs(angles)
        if half_turns:
            angles = angles[:, : angles.shape[1] // 2]
        # An object in the gripper turns by +angle if its window is cut at -angle.
        window = rotated_windows(query, (pick - 0.5) / 2, -angles, self.query_cells)  # (B, R, C, q, q)
        window = window * (self._window_weight(x.device) * self.log_scale.exp())
        return correlate_centered(key, window, half_turns).add_(self.bias(features).float())

    def _window_weight(self, device: torch.device) -> Tensor:
        """Return a learned Gaussian over the query window that sums to 1: (q, q)."""
        offsets = window_offsets(self.query_cells, torch.zeros(1, device=device))[0]  # (q, q, 2)
        weight = torch.exp(-offsets.square().sum(-1) / (2 * self.log_radius.exp().square()))
        return weight / weight.sum()
