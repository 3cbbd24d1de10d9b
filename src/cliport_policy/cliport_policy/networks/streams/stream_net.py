"""One net of streams: an image, a sentence and frozen features in, a map out (docs/paper.md, "Two streams")."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from cliport_policy.encoders.frozen import EncoderShape
from cliport_policy.networks.streams.fusion import StreamFusion
from cliport_policy.networks.streams.hourglass import Hourglass
from cliport_policy.networks.streams.semantic import SemanticDecoder, Taps
from cliport_policy.stream_config import NetConfig, StreamsConfig


class StreamNet(nn.Module):
    """Spatial stream, semantic stream, or both joined; it holds the learned layers, the encoders stay outside."""

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
        """Return a map (B, out, H, W).

        scene: (B, 4, H, W), colour in 0..1 and height in m, H and W multiples of 32. language: (B, text_dim).
        taps: frozen features of its colour, if there is a semantic stream.
        """
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
        """Return (B, 6, H, W) of (B, 4, H, W); outside the table is black and at height 0 before, not after."""
        color = (scene[:, :3] - self._color[0]) / self._color[1]
        height = (scene[:, 3:] - self._height[0]) / self._height[1]
        six = torch.cat((color, height.expand(-1, 3, -1, -1)), dim=1)
        return six.contiguous(memory_format=torch.channels_last)
