"""Residual blocks without normalisation, and the layers they are stacked with (docs/paper.md, "Layers")."""

from __future__ import annotations

import math

from torch import Tensor, nn
from torch.nn import functional as F


def convolution(channels_in: int, channels_out: int, side: int, stride: int = 1, bias: bool = False) -> nn.Conv2d:
    """Make a convolution that keeps the size and, before a ReLU, the variance, since no layer here normalises."""
    conv = nn.Conv2d(channels_in, channels_out, side, stride, padding=side // 2, bias=bias)
    nn.init.kaiming_normal_(conv.weight, nonlinearity="relu")
    if conv.bias is not None:
        nn.init.zeros_(conv.bias)
    return conv


def upsample(x: Tensor) -> Tensor:
    """Double the size: (B, C, H, W) -> (B, C, 2H, 2W), bilinear, corners on corners."""
    return F.interpolate(x, scale_factor=2, mode="bilinear", align_corners=True)


class ResidualBlock(nn.Module):
    """Convolutions 1x1, 3x3 (with the stride), 1x1 around a shortcut: the identity or a 1x1 convolution."""

    def __init__(self, channels_in: int, widths: tuple[int, int, int], stride: int = 1, shortcut: bool = False) -> None:
        super().__init__()
        a, b, c = widths
        self.reduce = convolution(channels_in, a, 1)
        self.conv = convolution(a, b, 3, stride)
        self.expand = convolution(b, c, 1)
        self.shortcut = convolution(channels_in, c, 1) if shortcut else None
        self.stride = stride
        # The sum's variance stays near that of the shortcut.
        nn.init.kaiming_normal_(self.expand.weight, a=math.sqrt(3), nonlinearity="leaky_relu")
        if self.shortcut is not None:
            nn.init.kaiming_normal_(self.shortcut.weight, a=1, nonlinearity="leaky_relu")

    def forward(self, x: Tensor, last_relu: bool = True) -> Tensor:
        """Return (B, widths[-1], H / stride, W / stride) of x (B, channels_in, H, W)."""
        y = F.relu_(self.reduce(x))
        y = self.expand(F.relu_(self.conv(y)))
        if self.shortcut is not None:
            # A strided 1x1 convolution reads every other cell: cut out here, for oneDNN's own crashes in training.
            x = self.shortcut(x[..., :: self.stride, :: self.stride])
        y = y + x
        return F.relu_(y) if last_relu else y


class ResidualPair(nn.Module):
    """Residual block that changes width (and size), followed by one that changes neither."""

    def __init__(
        self, channels_in: int, channels_out: int, stride: int = 1, inner: int | None = None, last_relu: bool = True
    ) -> None:
        super().__init__()
        widths = (inner or channels_out, inner or channels_out, channels_out)
        self.project = ResidualBlock(channels_in, widths, stride, shortcut=True)
        self.refine = ResidualBlock(channels_out, widths)
        self.last_relu = last_relu

    def forward(self, x: Tensor) -> Tensor:
        """Return (B, channels_out, H / stride, W / stride) of x (B, channels_in, H, W)."""
        return self.refine(self.project(x, self.last_relu), self.last_relu)
