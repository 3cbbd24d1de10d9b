"""The semantic stream's decoder: frozen features and a sentence to a map (spec, sections 11.4 and 12.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.networks.fusion import LanguageFusion, LateralFusion
from cliport_policy.networks.hourglass import scaled, shrink
from cliport_policy.networks.residual import ResidualPair, convolution, upsample

Taps = Sequence[Tensor]  # a frozen encoder's features at 1/4, 1/8, 1/16 and 1/32, finest first
_STEM = 1024
_WITH_SKIPS = (512, 256, 128, 64, 32, 16)  # at 1/16, 1/8, 1/4, 1/2, 1 and twice the size
_WITHOUT_SKIPS = (512, 128, 64, 32)  # at 1/16 .. 1/2; the last one is up-sampled to the size
_N_SKIPS = 3
_LANGUAGE_LEVELS = 3
_GROUPS = 32


class SkipLevel(nn.Module):
    """Up-sample, concatenate an encoder feature, two 3x3 convolutions, with or without group norm after each."""

    def __init__(self, channels_in: int, skip: int, channels_out: int, norm: str) -> None:
        super().__init__()
        self.conv1 = convolution(channels_in + skip, 2 * channels_out, 3, bias=True)
        self.conv2 = convolution(2 * channels_out, channels_out, 3, bias=True)
        self.norm1, self.norm2 = (
            nn.GroupNorm(math.gcd(_GROUPS, c), c) if norm == "group" else nn.Identity()
            for c in (2 * channels_out, channels_out)
        )

    def forward(self, x: Tensor, skip: Tensor | None) -> Tensor:
        assert skip is not None
        x = torch.cat((skip, upsample(x)), dim=1)
        return F.relu_(self.norm2(self.conv2(F.relu_(self.norm1(self.conv1(x))))))


class FineLevel(nn.Module):
    """A residual pair, then up-sampled: below the encoder's finest feature."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.pair = ResidualPair(channels_in, channels_out)

    def forward(self, x: Tensor, skip: Tensor | None) -> Tensor:
        return upsample(self.pair(x))


class BareLevel(nn.Module):
    """Up-sample, two residual pairs: a level of the decoder without skips."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.pairs = nn.Sequential(ResidualPair(channels_in, channels_out), ResidualPair(channels_out, channels_out))

    def forward(self, x: Tensor, skip: Tensor | None) -> Tensor:
        return self.pairs(upsample(x))


class SemanticDecoder(nn.Module):
    """From 1/32 to the size in levels; a sentence before the first three, the spatial stream's features after each."""

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
        self.levels = nn.ModuleList(
            self._level(level, a, b, tap_widths, skips, norm)
            for level, (a, b) in enumerate(zip(ins, outs, strict=True))
        )
        self.language = nn.ModuleList(
            LanguageFusion(language, text_dim, c) for c in (ins[:_LANGUAGE_LEVELS] if language != "none" else [])
        )
        self.laterals = nn.ModuleList(LateralFusion(a, b) for a, b in zip(outs, lateral_widths, strict=False))
        self.head = convolution(outs[-1], out, 1, bias=True)
        self.oversize = 2 if skips else 0.5  # of the last level's map

    @staticmethod
    def _level(level: int, a: int, b: int, tap_widths: Sequence[int], skips: bool, norm: str) -> nn.Module:
        if not skips:
            return BareLevel(a, b)
        return SkipLevel(a, tap_widths[2 - level], b, norm) if level < _N_SKIPS else FineLevel(a, b)

    def forward(self, taps: Taps, language: Tensor | None = None, laterals: Sequence[Tensor] = ()) -> Tensor:
        """taps of an image (B, 3, H, W), language: (B, text_dim), laterals coarsest first -> (B, out, H, W)."""
        x = F.relu_(self.stem(taps[-1]))
        for index, level in enumerate(self.levels):
            if index < len(self.language) and language is not None:
                x = self.language[index](x, language)
            x = level(x, taps[2 - index] if index < _N_SKIPS else None)
            if index < len(self.laterals):
                x = self.laterals[index](x, laterals[index])
        # Resizing and a 1x1 convolution can change places: the cheaper order.
        return upsample(self.head(x)) if self.oversize < 1 else self.head(shrink(x, int(self.oversize)))
