"""Aligner: how well what the gripper holds would fit at a place under a rotation."""

from __future__ import annotations

from torch import Tensor, nn

from cliport_policy.networks.compact.rotator import CropScorer
from cliport_policy.networks.policy_network import Placings
from cliport_policy.networks.rotation import rotated_windows


class Aligner(nn.Module):
    """Small CNN that scores the crops around pick and place together, both in the gripper's frame.

    The crop around the pick is turned by the gripper's yaw there, the one around the place by its yaw after each
    rotation. Where a rotation is right they fit: the thing lies on its hole, edges along edges.
    """

    def __init__(self, channels_in: int, goal_dim: int, crop_pixels: int) -> None:
        super().__init__()
        self.crop_pixels = crop_pixels
        self.scorer = CropScorer(2 * channels_in, goal_dim, crop_pixels)

    def forward(self, x: Tensor, goal: Tensor, placings: Placings) -> Tensor:
        """Return logits (B, R), of each place under its rotation. x: (B, C, H, W). goal: (B, G)."""
        pick, yaw, places, angles, cells = placings
        held = rotated_windows(x, pick, yaw[:, None], self.crop_pixels, cells)[:, 0]  # (B, C, side, side)
        below = rotated_windows(x, places, yaw[:, None] + angles, self.crop_pixels, cells)  # (B, R, C, side, side)
        scores: Tensor = self.scorer(below, goal, held)
        return scores
