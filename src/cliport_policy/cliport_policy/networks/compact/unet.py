"""Small residual U-Net whose blocks are modulated by a goal vector (FiLM)."""

from __future__ import annotations

from itertools import pairwise

from torch import Tensor, nn
from torch.nn import functional as F


class FilmResidualBlock(nn.Module):
    """Two 3x3 convolutions with batch norm around an identity; the goal scales and shifts the second one's output."""

    def __init__(self, channels: int, goal_dim: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm1 = nn.BatchNorm2d(channels)
        self.conv2 = nn.Conv2d(channels, channels, 3, padding=1, bias=False)
        self.norm2 = nn.BatchNorm2d(channels)
        self.film = nn.Linear(goal_dim, 2 * channels)
        nn.init.normal_(self.film.weight, std=0.02)
        nn.init.zeros_(self.film.bias)

    def forward(self, x: Tensor, goal: Tensor) -> Tensor:
        """Return (B, C, H, W) of x (B, C, H, W) and goal (B, G)."""
        scale, shift = self.film(goal).chunk(2, dim=1)  # (B, C) each
        y = F.relu_(self.norm1(self.conv1(x)))
        y = self.norm2(self.conv2(y))
        y = y * (1 + scale[:, :, None, None]) + shift[:, :, None, None]
        return F.relu_(x + y)


class Downsample(nn.Module):
    """Strided convolution to half the size and another width."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels_in, channels_out, 3, stride=2, padding=1, bias=False)
        self.norm = nn.BatchNorm2d(channels_out)

    def forward(self, x: Tensor) -> Tensor:
        """Return (B, channels_out, H/2, W/2) of x (B, channels_in, H, W)."""
        return F.relu_(self.norm(self.conv(x)))

    def beside(self, x: Tensor, same: Tensor) -> Tensor:
        """Return what forward returns of each of R inputs with `same` before it, which is convolved once.

        x: (B, R, C, H, W). same: (B, channels_in - C, H, W). The result is (B * R, channels_out, H/2, W/2).
        """
        for_same, for_each = self.conv.weight.tensor_split([same.shape[1]], dim=1)
        once = F.conv2d(same, for_same, stride=2, padding=1)
        if len(once) > 1:
            once = once.repeat_interleave(x.shape[1], dim=0)
        return F.relu_(self.norm(F.conv2d(x.flatten(0, 1), for_each, self.conv.bias, stride=2, padding=1) + once))


class FilmUNet(nn.Module):
    """U-Net from heightmap channels to features at half the heightmap's resolution.

    The stem folds 2x2 pixels into channels, so that the full resolution is read without being convolved.
    """

    def __init__(self, channels_in: int, widths: tuple[int, ...], goal_dim: int) -> None:
        super().__init__()
        self.stem = nn.Conv2d(4 * channels_in, widths[0], 3, padding=1, bias=False)
        self.stem_norm = nn.BatchNorm2d(widths[0])
        self.encoder = nn.ModuleList(FilmResidualBlock(width, goal_dim) for width in widths)
        self.down = nn.ModuleList(Downsample(a, b) for a, b in pairwise(widths))
        self.lateral = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in pairwise(widths))
        self.decoder = nn.ModuleList(FilmResidualBlock(width, goal_dim) for width in widths[:-1])

    def forward(self, x: Tensor, goal: Tensor) -> Tensor:
        """Return (B, widths[0], H/2, W/2) of x (B, channels_in, H, W), H and W even, and goal (B, G)."""
        x = F.pixel_unshuffle(x, 2)  # (B, 4 channels_in, H/2, W/2)
        x = F.relu_(self.stem_norm(self.stem(x)))
        skips: list[Tensor] = []
        for level, block in enumerate(self.encoder):
            if level > 0:
                skips.append(x)
                x = self.down[level - 1](x)
            x = block(x, goal)
        for level in reversed(range(len(skips))):
            skip = skips[level]
            x = F.interpolate(self.lateral[level](x), size=skip.shape[-2:], mode="bilinear", align_corners=False)
            x = self.decoder[level](x + skip, goal)
        return x
