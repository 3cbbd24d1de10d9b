"""Decoder of the semantic stream: frozen features and a sentence to a map (docs/paper.md, "Layers")."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.streams.fusion import LanguageFusion, LateralFusion
from cliport_policy.networks.streams.hourglass import scaled, shrink
from cliport_policy.networks.streams.residual import ResidualPair, convolution, upsample

Taps = Sequence[Tensor]  # a frozen encoder's features at 1/4, 1/8, 1/16 and 1/32, finest first
_STEM = 1024
_WITH_SKIPS = (512, 256, 128, 64, 32, 16)  # at 1/16, 1/8, 1/4, 1/2, 1 and twice the size
_WITHOUT_SKIPS = (512, 128, 64, 32)  # at 1/16 .. 1/2; the last one is up-sampled to the size
_N_SKIPS = 3
_LANGUAGE_LEVELS = 3
_GROUPS = 32


def _norm(kind: str, channels: int) -> nn.Module:
    return nn.GroupNorm(math.gcd(_GROUPS, channels), channels) if kind == "group" else nn.Identity()


class SkipLevel(nn.Module):
    """Decoder level with a skip: up-sample, concatenate a tap, two 3x3 convolutions, each with group norm or none."""

    def __init__(self, channels_in: int, skip: int, channels_out: int, norm: str) -> None:
        super().__init__()
        self.conv1 = convolution(channels_in + skip, 2 * channels_out, 3, bias=True)
        self.conv2 = convolution(2 * channels_out, channels_out, 3, bias=True)
        self.norm1, self.norm2 = _norm(norm, 2 * channels_out), _norm(norm, channels_out)

    def forward(self, x: Tensor, skip: Tensor | None) -> Tensor:
        """Return twice the size of x (B, C, H, W), joined with the tap."""
        assert skip is not None
        x = torch.cat((skip, upsample(x)), dim=1)
        return F.relu_(self.norm2(self.conv2(F.relu_(self.norm1(self.conv1(x))))))


class FineLevel(nn.Module):
    """Decoder level below the encoder's finest feature: a residual pair, then up-sampled."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.pair = ResidualPair(channels_in, channels_out)

    def forward(self, x: Tensor, skip: Tensor | None) -> Tensor:
        """Return twice the size of x (B, C, H, W); the tap is not read."""
        return upsample(self.pair(x))


class BareLevel(nn.Module):
    """Decoder level without skips: up-sample, two residual pairs."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.pairs = nn.Sequential(ResidualPair(channels_in, channels_out), ResidualPair(channels_out, channels_out))

    def forward(self, x: Tensor, skip: Tensor | None) -> Tensor:
        """Return twice the size of x (B, C, H, W); the tap is not read."""
        return self.pairs(upsample(x))


class SemanticDecoder(nn.Module):
    """Decoder from 1/32 to the full size, in levels.

    A sentence is fused before the first three, the spatial stream's features after each.
    """

    def __init__(
        self,
        tap_widths: Sequence[int],
        out: int,
        width: float = 1.0,
        skips: bool = True,
        norm: str = "none",
        language: str = "none",
        text_dim: int = 0,
        lateral_widths: Sequence[int] = (),
    ) -> None:
        super().__init__()
        outs = [scaled(c, width) for c in (_WITH_SKIPS if skips else _WITHOUT_SKIPS)]
        ins = [scaled(_STEM, width), *outs[:-1]]
        self.stem = convolution(tap_widths[-1], ins[0], 3)
        self.levels = nn.ModuleList()
        for level, (channels_in, channels_out) in enumerate(zip(ins, outs, strict=True)):
            self.levels.append(self._level(level, channels_in, channels_out, tap_widths, skips, norm))
        self.language = nn.ModuleList()
        if language != "none":
            for channels in ins[:_LANGUAGE_LEVELS]:
                self.language.append(LanguageFusion(language, text_dim, channels))
        self.laterals = nn.ModuleList(LateralFusion(a, b) for a, b in zip(outs, lateral_widths, strict=False))
        self.head = convolution(outs[-1], out, 1, bias=True)
        self.oversize = 2 if skips else 0.5  # factor from the full size to the last level's map

    @staticmethod
    def _level(level: int, a: int, b: int, tap_widths: Sequence[int], skips: bool, norm: str) -> nn.Module:
        if not skips:
            return BareLevel(a, b)
        return SkipLevel(a, tap_widths[2 - level], b, norm) if level < _N_SKIPS else FineLevel(a, b)

    def forward(self, taps: Taps, language: Tensor | None = None, laterals: Sequence[Tensor] = ()) -> Tensor:
        """Return a map (B, out, H, W).

        taps: frozen features of images (B, 3, H, W). language: (B, text_dim). laterals: coarsest first.
        """
        x = F.relu_(self.stem(taps[-1]))
        for index, level in enumerate(self.levels):
            if index < len(self.language) and language is not None:
                x = self.language[index](x, language)
            x = level(x, taps[2 - index] if index < _N_SKIPS else None)
            if index < len(self.laterals):
                x = self.laterals[index](x, laterals[index])
        # Resizing and a 1x1 convolution can change places: the cheaper order.
        return upsample(self.head(x)) if self.oversize < 1 else self.head(shrink(x, int(self.oversize)))
