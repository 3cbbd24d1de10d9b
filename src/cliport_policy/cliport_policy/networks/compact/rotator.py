"""Rotator: a score for each rotation of the crop around the pick (paper, appendix D)."""

from __future__ import annotations

from torch import Tensor, nn

from cliport_policy.networks.compact.unet import Downsample, FilmResidualBlock
from cliport_policy.networks.rotation import rotated_windows


class CropScorer(nn.Module):
    """Small CNN that gives each of several crops a score."""

    def __init__(self, channels_in: int, goal_dim: int, crop_pixels: int, width: int = 16) -> None:
        super().__init__()
        self.crop_pixels = crop_pixels
        self.down = nn.ModuleList(
            (Downsample(channels_in, width), Downsample(width, 2 * width), Downsample(2 * width, 2 * width))
        )
        self.block = FilmResidualBlock(2 * width, goal_dim)
        self.head = nn.Linear(2 * width * (crop_pixels // 8) ** 2, 1)

    def forward(self, crops: Tensor, goal: Tensor, held: Tensor | None = None) -> Tensor:
        """Return logits (B, R) of crops (B, R, C, side, side) and goals (B, G).

        held: (B, channels_in - C, side, side), seen before each crop's own channels, where these are not all.
        """
        batch, n = crops.shape[:2]
        first, *others = self.down
        y = first(crops.flatten(0, 1)) if held is None else first.beside(crops, held)
        for down in others:
            y = down(y)
        y = self.block(y, goal.repeat_interleave(n, dim=0))
        return self.head(y.flatten(1)).reshape(batch, n)


class Rotator(CropScorer):
    """Scorer of the crop around the pick, turned by each angle; the right one shows the object along the gripper."""

    def forward(self, x: Tensor, goal: Tensor, pick: Tensor, angles: Tensor) -> Tensor:  # type: ignore[override]
        """Return logits (B, R).

        x: (B, C, H, W). goal: (B, G). pick: (B, 2) float pixel (row, col). angles: (B, R) rad.
        """
        return super().forward(rotated_windows(x, pick, angles, self.crop_pixels), goal)
