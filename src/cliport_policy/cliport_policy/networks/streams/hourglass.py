"""Spatial stream: a residual hourglass over colour and depth (docs/paper.md, "Layers")."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.streams.fusion import LanguageFusion
from cliport_policy.networks.streams.residual import ResidualPair, convolution, upsample

CHANNELS_IN = 6  # red, green, blue and three times the height
_ENCODER = {"plain": (64, 128, 256, 512), "lateral": (64, 128, 256, 512, 1024)}
_DECODER = {"plain": (256, 128, 64), "lateral": (512, 256, 128, 64, 32)}
_HEAD = 16
_LANGUAGE_LEVELS = 3


def scaled(channels: int, width: float) -> int:
    """Return a channel count of the tables at another width."""
    return max(1, round(channels * width))


class SpatialFeatures(NamedTuple):
    """Output of the spatial stream.

    map: (B, out, H, W). laterals: inputs of the decoder's stages and of the head, coarsest first.
    """

    map: Tensor
    laterals: list[Tensor]


class Hourglass(nn.Module):
    """Residual hourglass of one of two depths.

    `plain`: down to 1/8 and back, 57 convolutions. `lateral`: down to 1/16, up to twice the size and back, 78.
    """

    def __init__(self, kind: str, out: int, width: float = 1.0, language: str = "none", text_dim: int = 0) -> None:
        super().__init__()
        down = [scaled(c, width) for c in _ENCODER[kind]]
        up = [scaled(c, width) for c in _DECODER[kind]]
        self.stem = convolution(CHANNELS_IN, down[0], 3, bias=True)
        self.encoder = nn.ModuleList([ResidualPair(down[0], down[0], stride=1)])
        for a, b in pairwise(down):
            self.encoder.append(ResidualPair(a, b, stride=2))
        self.lateral_widths = [down[-1], *up]
        self.decoder = nn.ModuleList(ResidualPair(a, b) for a, b in pairwise(self.lateral_widths))
        self.head = ResidualPair(up[-1], out, inner=scaled(_HEAD, width), last_relu=False)
        self.oversize = 2 ** (len(up) - len(down) + 1)  # factor from the full size to the head's map
        self.language = nn.ModuleList()
        if language != "none":
            for channels in self.lateral_widths[:_LANGUAGE_LEVELS]:
                self.language.append(LanguageFusion(language, text_dim, channels))

    def forward(self, x: Tensor, language: Tensor | None = None) -> SpatialFeatures:
        """Return the features of x (B, 6, H, W), H and W multiples of 16.

        language: (B, text_dim), if the net reads it.
        """
        x = F.relu_(self.stem(x))
        for pair in self.encoder:
            x = pair(x)
        laterals: list[Tensor] = []
        for level, pair in enumerate([*self.decoder, self.head]):
            if level < len(self.language) and language is not None:
                x = self.language[level](x, language)
            laterals.append(x)
            x = pair(x)
            if pair is not self.head:
                x = upsample(x)
        return SpatialFeatures(shrink(x, self.oversize), laterals)


def shrink(x: Tensor, factor: int) -> Tensor:
    """Resize (B, C, H, W) to (B, C, H / factor, W / factor), bilinear; halving is the mean of 2x2."""
    return F.avg_pool2d(x, factor) if factor > 1 else x
