"""Fusion of a sentence with a feature map, and of two streams' maps (docs/paper.md, "Layers")."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.streams.residual import convolution


class LanguageFusion(nn.Module):
    """Fusion of a map with a sentence's vector, tiled over it: `multiply`, or `film` (scale and shift)."""

    def __init__(self, kind: str, text_dim: int, channels: int) -> None:
        super().__init__()
        self.project = nn.Linear(text_dim, channels if kind == "multiply" else 2 * channels)
        nn.init.zeros_(self.project.bias)
        nn.init.ones_(self.project.bias[:channels])  # an untrained fusion passes the features on

    def forward(self, x: Tensor, language: Tensor) -> Tensor:
        """Return (B, C, H, W) of x (B, C, H, W) and language (B, text_dim)."""
        scale, *shift = self.project(language)[:, :, None, None].split(x.shape[1], dim=1)
        return x * scale + shift[0] if shift else x * scale


class LateralFusion(nn.Module):
    """Fusion of the spatial stream's features with the semantic ones: concatenated, ReLU, 1x1 to the semantic width."""

    def __init__(self, channels: int, lateral: int) -> None:
        super().__init__()
        self.project = convolution(channels + lateral, channels, 1)

    def forward(self, x: Tensor, lateral: Tensor) -> Tensor:
        """Return (B, channels, H, W) of x (B, channels, H, W) and lateral (B, C, H, W)."""
        # The sum of a 1x1 for each map: the same, without joining the two largest maps of all first.
        inner, outer = self.project.weight.split((x.shape[1], lateral.shape[1]), dim=1)
        return F.conv2d(F.relu(x), inner) + F.conv2d(F.relu(lateral), outer)


class StreamFusion(nn.Module):
    """Fusion of two maps of C channels: `add`, or `concat` (concatenated, ReLU, 1x1 to C)."""

    def __init__(self, kind: str, channels: int) -> None:
        super().__init__()
        self.project = convolution(2 * channels, channels, 1) if kind == "concat" else None

    def forward(self, spatial: Tensor, semantic: Tensor) -> Tensor:
        """Return (B, C, H, W) of two maps (B, C, H, W)."""
        if self.project is None:
            return spatial + semantic
        return self.project(F.relu_(torch.cat((spatial, semantic), dim=1)))
