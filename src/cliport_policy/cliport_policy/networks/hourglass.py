"""The spatial stream: a residual hourglass over colour and depth (spec, sections 11.2 and 11.3)."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.fusion import LanguageFusion
from cliport_policy.networks.residual import ResidualPair, convolution, upsample

CHANNELS_IN = 6  # red, green, blue and three times the height
_ENCODER = {"plain": (64, 128, 256, 512), "lateral": (64, 128, 256, 512, 1024)}
_DECODER = {"plain": (256, 128, 64), "lateral": (512, 256, 128, 64, 32)}
_HEAD = 16
_LANGUAGE_LEVELS = 3


def scaled(channels: int, width: float) -> int:
    """A channel count of the tables at another width."""
    return max(1, round(channels * width))


class SpatialFeatures(NamedTuple):
    """The map, (B, out, H, W), and the inputs of the decoder's stages and of the head, coarsest first."""

    map: Tensor
    laterals: list[Tensor]


class Hourglass(nn.Module):
    """`plain`: down to 1/8 and back, 57 convolutions. `lateral`: down to 1/16, up to twice the size and back, 78."""

    def __init__(self, kind: str, out: int, width: float = 1.0, language: str = "none", text_dim: int = 0) -> None:
        super().__init__()
        down = [scaled(c, width) for c in _ENCODER[kind]]
        up = [scaled(c, width) for c in _DECODER[kind]]
        self.stem = convolution(CHANNELS_IN, down[0], 3, bias=True)
        self.encoder = nn.ModuleList(
            ResidualPair(a, b, stride=1 if level == 0 else 2)
            for level, (a, b) in enumerate(zip([down[0], *down[:-1]], down, strict=True))
        )
        self.lateral_widths = [down[-1], *up]
        self.decoder = nn.ModuleList(ResidualPair(a, b) for a, b in zip(self.lateral_widths[:-1], up, strict=True))
        self.head = ResidualPair(up[-1], out, inner=scaled(_HEAD, width), last_relu=False)
        self.oversize = 2 ** (len(up) - len(down) + 1)  # of the head's map
        self.language = nn.ModuleList(
            LanguageFusion(language, text_dim, c)
            for c in (self.lateral_widths[:_LANGUAGE_LEVELS] if language != "none" else [])
        )

    def forward(self, x: Tensor, language: Tensor | None = None) -> SpatialFeatures:
        """x: (B, 6, H, W) with H and W multiples of 16, language: (B, text_dim) where it is read."""
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
    """(B, C, H, W) -> (B, C, H / factor, W / factor), bilinear; halving it is the mean of 2x2."""
    return F.avg_pool2d(x, factor) if factor > 1 else x
