"""How a sentence enters a feature map, and how two streams' maps become one (spec, section 11.4)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.residual import convolution


class LanguageFusion(nn.Module):
    """A sentence's vector, made as wide as the map, tiled over it: `multiply`, or `film` (scale and shift)."""

    def __init__(self, kind: str, text_dim: int, channels: int) -> None:
        super().__init__()
        self.project = nn.Linear(text_dim, channels if kind == "multiply" else 2 * channels)
        nn.init.zeros_(self.project.bias)
        nn.init.ones_(self.project.bias[:channels])  # an untrained fusion passes the features on

    def forward(self, x: Tensor, language: Tensor) -> Tensor:
        """x: (B, C, H, W), language: (B, text_dim) -> (B, C, H, W)."""
        scale, *shift = self.project(language)[:, :, None, None].split(x.shape[1], dim=1)
        return x * scale + shift[0] if shift else x * scale


class LateralFusion(nn.Module):
    """The spatial stream's features join the semantic ones: concatenated, ReLU, 1x1 back to the semantic width."""

    def __init__(self, channels: int, lateral: int) -> None:
        super().__init__()
        self.project = convolution(channels + lateral, channels, 1)

    def forward(self, x: Tensor, lateral: Tensor) -> Tensor:
        # The 1x1 of both, one after the other: the same, without joining the two largest maps of all first.
        inner, outer = self.project.weight.split((x.shape[1], lateral.shape[1]), dim=1)
        return F.conv2d(F.relu(x), inner) + F.conv2d(F.relu(lateral), outer)


class StreamFusion(nn.Module):
    """Two maps of C channels to one: `add`, or `concat` (concatenated, ReLU, 1x1 to C)."""

    def __init__(self, kind: str, channels: int) -> None:
        super().__init__()
        self.project = convolution(2 * channels, channels, 1) if kind == "concat" else None

    def forward(self, spatial: Tensor, semantic: Tensor) -> Tensor:
        if self.project is None:
            return spatial + semantic
        return self.project(F.relu_(torch.cat((spatial, semantic), dim=1)))
