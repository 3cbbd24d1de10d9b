"""The compact policy network: goal reader, locator, rotator and transport in one module, real time on a CPU."""

from __future__ import annotations

from torch import Tensor, nn

from cliport_policy.config import NetworkConfig
from cliport_policy.networks.goal_reader import GoalReader
from cliport_policy.networks.locator import Locator
from cliport_policy.networks.rotator import Rotator
from cliport_policy.networks.transport import Transport
from cliport_policy.observation import CHANNELS


class CompactNetwork(nn.Module):
    """The three networks share nothing but the frozen text encoder's embeddings and the goal reader."""

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
