"""Network that tells, cell by cell, whether a thing of a kind and a colour lies there."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.observation import CHANNELS

STRIDE = 4  # pixels of the heightmap along the side of a cell
_WIDTHS = (24, 48, 96)  # at 1/2, 1/4 and 1/8 of the resolution
_FEATURES = 48
_HIDDEN = 32
_NARROW = 16
_NEAR, _WIDE, _AROUND = 3, 7, 5  # cells along the sides of squares over which a colour's map is summed up
EVIDENCE = 6  # numbers that say how much of a colour is near a cell, and whether any colour will do
_RARE = -4.0  # logit at first: most cells hold no such thing


class _Residual(nn.Module):
    """Two 3x3 convolutions around an identity."""

    def __init__(self, channels: int, dilation: int = 1) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation, bias=False)
        self.norm1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm2 = nn.BatchNorm2d(channels)

    def forward(self, x: Tensor) -> Tensor:
        """Return (B, C, H, W) of x (B, C, H, W)."""
        return F.relu_(x + self.norm2(self.conv2(F.relu_(self.norm1(self.conv1(x))))))


class SceneNet(nn.Module):
    """Features of a scene, and how well each cell suits a kind and a colour.

    What a scene looks like is asked once; any number of kinds and colours can be asked about then.
    """

    def __init__(self, n_kinds: int, n_colors: int) -> None:
        """Make random weights for kinds, and for colours that demonstrations named; 0 stands for any other."""
        super().__init__()
        stem, middle, coarse = _WIDTHS
        self.stem = _halving(4 * CHANNELS, stem, stride=1)
        self.down1 = _halving(stem, middle)
        self.block1 = _Residual(middle)
        self.down2 = _halving(middle, coarse)
        self.block2 = nn.Sequential(_Residual(coarse), _Residual(coarse, dilation=2))
        self.lateral = nn.Conv2d(coarse, _FEATURES, 1)
        self.skip = nn.Conv2d(middle, _FEATURES, 1)
        self.block3 = _Residual(_FEATURES)
        self.kind_head = nn.Conv2d(_FEATURES, n_kinds, 1)
        self.seen = nn.Linear(_FEATURES, _HIDDEN)
        self.colored = nn.Linear(EVIDENCE, _HIDDEN)
        self.kind = nn.Embedding(n_kinds, _HIDDEN)
        self.gate = nn.Embedding(n_kinds, _HIDDEN)
        self.color = nn.Embedding(n_colors + 1, _HIDDEN, padding_idx=0)
        self.narrow = nn.Linear(_HIDDEN, _NARROW)
        self.out = nn.Linear(_NARROW, 1)
        nn.init.normal_(self.gate.weight, std=0.1)
        nn.init.constant_(self.out.bias, _RARE)

    def features(self, images: Tensor) -> Tensor:
        """Return features (B, 48, H/4, W/4) of observations (B, 5, H, W)."""
        fine = self.block1(self.down1(self.stem(F.pixel_unshuffle(images, 2))))
        coarse = self.lateral(self.block2(self.down2(fine)))
        up = F.interpolate(coarse, size=fine.shape[-2:], mode="bilinear", align_corners=False)
        out: Tensor = self.block3(self.skip(fine) + up)
        return out

    def score(self, features: Tensor, evidence: Tensor, kinds: Tensor, colors: Tensor) -> Tensor:
        """Return logits (B, Q, h, w) of Q questions about each scene.

        features: (B, 48, h, w). evidence: (B, Q, 6, h, w), of `evidence`. kinds, colors: (B, Q) numbers.
        """
        seen = self.seen(features.permute(0, 2, 3, 1))[:, None]  # (B, 1, h, w, D)
        colored = self.colored(evidence.permute(0, 1, 3, 4, 2))
        asked = (self.kind(kinds) + self.color(colors))[:, :, None, None]
        x = F.gelu(seen * (1 + self.gate(kinds))[:, :, None, None] + colored + asked)
        out: Tensor = self.out(F.gelu(self.narrow(x)))[..., 0]
        return out


def evidence(maps: Tensor, any_color: Tensor) -> Tensor:
    """Return how much of a colour is in and around each cell: (B, Q, 6, h, w).

    maps: (B, Q, H/2, W/2) in 0..1, of where the colour is seen. any_color: (B, Q) bool, no colour was asked for.
    """
    mean = F.avg_pool2d(maps, 2, ceil_mode=True)
    most = F.max_pool2d(maps, 2, ceil_mode=True)
    parts = (
        mean,
        most,
        F.avg_pool2d(mean, _NEAR, 1, _NEAR // 2),
        F.avg_pool2d(mean, _WIDE, 1, _WIDE // 2),
        F.max_pool2d(most, _AROUND, 1, _AROUND // 2),
    )
    free = any_color[:, :, None, None].to(maps.dtype).expand_as(mean)
    return torch.stack((*(part * (1 - free) for part in parts), free), dim=2)


def grayed(images: Tensor, gray: Tensor) -> Tensor:
    """Return observations (B, 5, H, W) with the chosen ones (B,) in grey: red, green and blue their mean."""
    mean = images[:, :3].mean(1, keepdim=True).expand(-1, 3, -1, -1)
    color = torch.where(gray[:, None, None, None], mean, images[:, :3])
    return torch.cat((color, images[:, 3:]), dim=1).contiguous(memory_format=torch.channels_last)


def _halving(channels_in: int, channels_out: int, stride: int = 2) -> nn.Sequential:
    conv = nn.Conv2d(channels_in, channels_out, 3, stride=stride, padding=1, bias=False)
    return nn.Sequential(conv, nn.BatchNorm2d(channels_out), nn.ReLU(inplace=True))
