"""CLIP's ResNet up to its last stage and its sentence encoder, under the names that OpenAI's checkpoint gives them.

open_clip has both, too, but its import takes 4 s and 300 MB more; the tests hold these against it.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

_EXPANSION = 4
_HEAD_WIDTH = 64


class _Bottleneck(nn.Module):
    """Convolutions 1x1, 3x3, 1x1 around a shortcut; strides are average pools."""

    def __init__(self, channels_in: int, width: int, stride: int) -> None:
        super().__init__()
        out = width * _EXPANSION
        self.conv1, self.bn1 = nn.Conv2d(channels_in, width, 1, bias=False), nn.BatchNorm2d(width)
        self.conv2, self.bn2 = nn.Conv2d(width, width, 3, padding=1, bias=False), nn.BatchNorm2d(width)
        self.conv3, self.bn3 = nn.Conv2d(width, out, 1, bias=False), nn.BatchNorm2d(out)
        self.downsample = None
        if stride > 1 or channels_in != out:
            self.downsample = nn.Sequential(nn.Conv2d(channels_in, out, 1, bias=False), nn.BatchNorm2d(out))
        self.stride = stride

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu(self.bn1(self.conv1(x)))
        y = self._pool(F.relu(self.bn2(self.conv2(y))))
        y = self.bn3(self.conv3(y))
        return F.relu(y + (x if self.downsample is None else self.downsample(self._pool(x))))

    def _pool(self, x: Tensor) -> Tensor:
        return F.avg_pool2d(x, self.stride) if self.stride > 1 else x


class _Stem(nn.Module):
    """Three convolutions and an average pool: to 1/4."""

    def __init__(self, width: int) -> None:
        super().__init__()
        half = width // 2
        self.conv1, self.bn1 = nn.Conv2d(3, half, 3, 2, 1, bias=False), nn.BatchNorm2d(half)
        self.conv2, self.bn2 = nn.Conv2d(half, half, 3, 1, 1, bias=False), nn.BatchNorm2d(half)
        self.conv3, self.bn3 = nn.Conv2d(half, width, 3, 1, 1, bias=False), nn.BatchNorm2d(width)

    def forward(self, x: Tensor) -> Tensor:
        x = F.relu(self.bn1(self.conv1(x)))
        x = F.relu(self.bn2(self.conv2(x)))
        return F.avg_pool2d(F.relu(self.bn3(self.conv3(x))), 2)


class ClipResNet(nn.Module):
    """CLIP's ResNet: the stem and four stages, whose outputs have 4, 8, 16 and 32 times `width` channels."""

    def __init__(self, width: int, blocks: Sequence[int]) -> None:
        super().__init__()
        self.stem = _Stem(width)
        channels = width
        for stage, count in enumerate(blocks):
            inner = width * 2**stage
            layer = nn.Sequential()
            for block in range(count):
                layer.append(_Bottleneck(channels, inner, 2 if stage > 0 and block == 0 else 1))
                channels = inner * _EXPANSION
            self.add_module(f"layer{stage + 1}", layer)

    @property
    def stages(self) -> list[nn.Module]:
        """Stem and stages, in order."""
        return [self.stem, self.layer1, self.layer2, self.layer3, self.layer4]


class _TextBlock(nn.Module):
    """Self-attention to what came before, and a perceptron, each behind its layer norm."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.ln_1, self.ln_2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attn = nn.MultiheadAttention(width, width // _HEAD_WIDTH, batch_first=True)
        self.mlp = nn.ModuleDict({"c_fc": nn.Linear(width, 4 * width), "c_proj": nn.Linear(4 * width, width)})

    def forward(self, x: Tensor, mask: Tensor) -> Tensor:
        y = self.ln_1(x)
        x = x + self.attn(y, y, y, attn_mask=mask, need_weights=False, is_causal=True)[0]
        y = self.mlp["c_fc"](self.ln_2(x))
        return x + self.mlp["c_proj"](y * torch.sigmoid(1.702 * y))  # GELU as CLIP approximates it


class ClipText(nn.Module):
    """CLIP's sentence encoder, up to the projected feature at a sentence's last token."""

    def __init__(self, vocabulary: int, context: int, width: int, layers: int, dim: int) -> None:
        super().__init__()
        self.token_embedding = nn.Embedding(vocabulary, width)
        self.positional_embedding = nn.Parameter(torch.empty(context, width))
        self.transformer = nn.ModuleDict({"resblocks": nn.ModuleList(_TextBlock(width) for _ in range(layers))})
        self.ln_final = nn.LayerNorm(width)
        self.text_projection = nn.Parameter(torch.empty(width, dim))

    def forward(self, tokens: Tensor) -> Tensor:
        """Return the features (B, dim) of token numbers (B, context), not normalised."""
        length = int(tokens.argmax(1).max()) + 1  # the end's number is the highest; what follows it changes nothing
        x = self.token_embedding(tokens[:, :length]) + self.positional_embedding[:length]
        mask = torch.full((length, length), float("-inf"), dtype=x.dtype, device=x.device).triu(1)
        for block in self.transformer["resblocks"]:
            x = block(x, mask)
        last = x[torch.arange(len(x), device=x.device), tokens.argmax(1)]
        return self.ln_final(last) @ self.text_projection
