"""The compact policy network: goal reader, locator, rotator and transport in one module, real time on a CPU."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from cliport_policy.config import NetworkConfig
from cliport_policy.language import shared_encoder
from cliport_policy.networks.goal_reader import GoalReader
from cliport_policy.networks.locator import Locator
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.networks.rotator import Rotator
from cliport_policy.networks.transport import Transport
from cliport_policy.observation import CHANNELS, without_heights


class CompactNetwork(PolicyNetwork):
    """The three networks share nothing but the frozen text encoder's embeddings and the goal reader."""

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
        """(B, T, token_dim), (B, T) -> (B, 2 * goal_dim)."""
        goal: Tensor = self.goal_reader(tokens, mask)
        return goal

    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        tokens, mask = shared_encoder().batch(sentences if self.config.language else [""] * len(sentences))
        device = self.locator.null_score.device
        return Goal(self.read_goal(tokens.to(device), mask.to(device)))

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        return self.locator(self._seen(images), goal.language)

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        return self.rotator(self._seen(images), goal.language, pick, angles)

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        return self.transport(self._seen(images), goal.language, pick, angles)

    def _seen(self, images: Tensor) -> Tensor:
        return images if self.config.heights else without_heights(images)
