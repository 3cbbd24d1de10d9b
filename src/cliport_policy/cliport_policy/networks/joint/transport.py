"""Transport of the joint network: gated correlation of what is picked with the scene, and a bias."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.correlation import correlate_centered
from cliport_policy.networks.rotation import are_opposite_pairs, rotated_windows, window_offsets


class GatedTransport(nn.Module):
    """Cross-correlation of a window of query features with the key features, plus a bias.

    Query and key are unit vectors a cell, times a gate in 0..1: a cell of bare table may have no say. The bias is the
    product of the scene's features with a vector that the features at the pick give.
    """

    def __init__(self, width: int, channels: int, query_cells: int, gate: bool) -> None:
        super().__init__()
        self.query_cells, self.gate, self.channels = query_cells, gate, channels
        self.key = nn.Conv2d(width, channels + gate, 1)
        self.query = nn.Conv2d(width, channels + gate, 1)
        self.bias = nn.Conv2d(width, 1, 1)
        self.at_pick = nn.Linear(width, width)
        self.log_scale = nn.Parameter(torch.tensor(2.5))
        self.log_radius = nn.Parameter(torch.tensor(1.5))

    def forward(self, features: Tensor, pick: Tensor, angles: Tensor) -> Tensor:
        """Return logits (B, R, H/2, W/2).

        features: (B, width, H/2, W/2). pick: (B, 2) float pixel (row, col). angles: (B, R) rad relative to the pick's
        yaw.
        """
        key, query = self._gated(self.key(features)), self._gated(self.query(features))
        half_turns = are_opposite_pairs(angles)
        if half_turns:
            angles = angles[:, : angles.shape[1] // 2]
        # An object in the gripper turns by +angle if its window is cut at -angle.
        window = rotated_windows(query, _cell(pick), -angles, self.query_cells)
        window = window * (self._window_weight(query.device) * self.log_scale.exp())  # (B, R, C, q, q)
        picked = rotated_windows(features.float(), _cell(pick), angles[:, :1] * 0, 1).flatten(1)  # (B, width)
        bias = (
            self.bias(features).float()
            + torch.einsum("bchw,bc->bhw", features.float(), self.at_pick(picked).float())[:, None]
        )
        return correlate_centered(key, window, half_turns).add_(bias)

    def _gated(self, x: Tensor) -> Tensor:
        x = x.float()
        unit = F.normalize(x[:, : self.channels], dim=1)
        return unit * x[:, self.channels :].sigmoid() if self.gate else unit

    def _window_weight(self, device: torch.device) -> Tensor:
        """Return a learned Gaussian over the query window that sums to 1: (q, q)."""
        offsets = window_offsets(self.query_cells, torch.zeros(1, device=device))[0]  # (q, q, 2)
        weight = torch.exp(-offsets.square().sum(-1) / (2 * self.log_radius.exp().square()))
        return weight / weight.sum()


def _cell(pixels: Tensor) -> Tensor:
    """Return the float cells (B, 2) at half resolution of pixels (B, 2)."""
    return (pixels - 0.5) / 2
