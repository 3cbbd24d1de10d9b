"""One net of streams: an image, a sentence and frozen features in, a map out (spec, section 10)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from cliport_policy.networks.fusion import StreamFusion
from cliport_policy.networks.hourglass import Hourglass
from cliport_policy.networks.semantic import SemanticDecoder, Taps
from cliport_policy.stream_config import NetConfig, StreamsConfig


class EncoderShape(NamedTuple):
    """What a network must know of its frozen encoders to be built.

    tap_widths: channels at 1/4, 1/8, 1/16 and 1/32. text_dim: of a sentence's vector.
    projected_dim: width of a learned projection of it, where the encoder has none of its own; 0: no projection.
    """

    tap_widths: tuple[int, ...]
    text_dim: int
    projected_dim: int = 0


class StreamNet(nn.Module):
    """Spatial stream, semantic stream, or both joined. Holds what learns; the encoders stay outside."""

    def __init__(self, net: NetConfig, config: StreamsConfig, shape: EncoderShape, out: int) -> None:
        super().__init__()
        self.reads_taps = net.semantic
        self._color = (config.color_mean, config.color_std)
        self._height = (config.height_mean, config.height_std)
        speaks = net.language != "none"
        text_dim = shape.projected_dim or shape.text_dim
        self.text = nn.Linear(shape.text_dim, shape.projected_dim) if speaks and shape.projected_dim else None
        self.spatial = self.semantic = self.fusion = None
        if net.spatial != "none":
            alone = "none" if net.semantic else net.language
            self.spatial = Hourglass(net.spatial, out, config.width, alone, text_dim)
        if net.semantic:
            laterals = self.spatial.lateral_widths if net.laterals and self.spatial is not None else ()
            self.semantic = SemanticDecoder(
                shape.tap_widths, out, config.width, net.skips, net.norm, net.language, text_dim, laterals
            )
        if net.fusion != "none":
            self.fusion = StreamFusion(net.fusion, out)

    def forward(self, scene: Tensor, language: Tensor | None = None, taps: Taps | None = None) -> Tensor:
        """scene: (B, 4, H, W) colour in 0..1 and height in m, H and W multiples of 32; language: (B, text_dim);
        taps: the frozen features of its colour, where there is a semantic stream -> (B, out, H, W)."""
        dtype = next(self.parameters()).dtype
        if language is not None:
            language = language.to(dtype)
            language = language if self.text is None else self.text(language)
        if self.spatial is None:
            return self._decode(taps, language, (), dtype)
        spatial = self.spatial(self._normalised(scene).to(dtype), language)
        if self.fusion is None:
            return spatial.map
        return self.fusion(spatial.map, self._decode(taps, language, spatial.laterals, dtype))

    def _decode(
        self, taps: Taps | None, language: Tensor | None, laterals: Sequence[Tensor], dtype: torch.dtype
    ) -> Tensor:
        assert self.semantic is not None and taps is not None
        return self.semantic([tap.to(dtype) for tap in taps], language, laterals)

    def _normalised(self, scene: Tensor) -> Tensor:
        """(B, 4, H, W) -> (B, 6, H, W): what lies outside the table is black and at height 0 before, not after."""
        color = (scene[:, :3] - self._color[0]) / self._color[1]
        height = (scene[:, 3:] - self._height[0]) / self._height[1]
        six = torch.cat((color, height.expand(-1, 3, -1, -1)), dim=1)
        return six.contiguous(memory_format=torch.channels_last)
