"""Compact policy network: goal reader, locator, rotator and transport in one module, real time on a CPU."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from cliport_policy.config import NetworkConfig
from cliport_policy.language import shared_encoder
from cliport_policy.networks.compact.goal_reader import GoalReader
from cliport_policy.networks.compact.locator import Locator
from cliport_policy.networks.compact.rotator import Rotator
from cliport_policy.networks.compact.transport import Transport
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.observation import CHANNELS, without_heights, without_mask


class CompactNetwork(PolicyNetwork):
    """Locator, rotator and transport that share only the goal reader behind the frozen text encoder."""

    config: NetworkConfig
    cell_size = 2

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        goal_dim = 2 * config.goal_dim
        self.goal_reader = GoalReader(config.token_dim, config.goal_dim)
        self.locator = Locator(CHANNELS, config.widths, goal_dim)
        self.rotator = Rotator(CHANNELS, goal_dim, config.crop_pixels)
        self.transport = Transport(CHANNELS, config.widths, goal_dim, config.transport_channels, config.query_cells)

    def read_goal(self, tokens: Tensor, mask: Tensor) -> Tensor:
        """Return goal vectors (B, 2 * goal_dim) of tokens (B, T, token_dim) and their mask (B, T)."""
        goal: Tensor = self.goal_reader(tokens, mask)
        return goal

    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        """Return the goals of B sentences; images are not read."""
        tokens, mask = shared_encoder().encode_cached(sentences if self.config.language else [""] * len(sentences))
        device = self.locator.null_score.device
        return Goal(self.read_goal(tokens.to(device), mask.to(device)))

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        """Return logits (B, h * w + 1), the last one the null action's."""
        return self.locator(self._seen(images), goal.language)

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        """Return logits (B, R) of the gripper's yaw."""
        return self.rotator(self._seen(images), goal.language, pick, angles)

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        """Return logits (B, R, h, w)."""
        return self.transport(self._seen(images), goal.language, pick, angles)

    def _seen(self, images: Tensor) -> Tensor:
        images = images if self.config.heights else without_heights(images)
        return images if self.config.mask else without_mask(images)
