"""What every network of a policy can do, so that one training step and one `infer` serve them all."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor, nn

from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.rotation import bin_angles


@dataclass(frozen=True)
class Goal:
    """A batch of goals: what the sentences say, (B, D), and what it shall look like, (B, 5, H, W), where given."""

    language: Tensor | None = None
    images: Tensor | None = None

    def select(self, index: Tensor) -> Goal:
        """Those of some entries: a bool mask (B,) or indices."""
        return Goal(*(None if part is None else part[index] for part in (self.language, self.images)))


class PolicyNetwork(nn.Module, ABC):
    """Observations are (B, 5, H, W) as observation.py makes them. Pixels are float (row, col); angles in rad.

    cell_size: pixels along the side of one cell of the pick's and the place's maps; h = H / cell_size, w likewise.
    """

    config: AnyNetworkConfig
    cell_size: int

    @property
    def needs_goal_image(self) -> bool:
        """Whether encode_goal must be given goal images."""
        return False

    @property
    def encoder_identity(self) -> str:
        """Which frozen encoders the weights belong to, where they are not the policy's own sentence encoder."""
        return ""

    def compile_parts(self, backend: str = "inductor") -> None:
        """Let torch compile each net at its first use: half a minute then, faster afterwards."""
        for module in self.children():
            parts = module.values() if isinstance(module, nn.ModuleDict) else (module,)
            for part in parts:
                part.compile(backend=backend)

    @abstractmethod
    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        """B sentences, and (B, 5, H, W) goal images where the network needs them, on the network's device."""

    @abstractmethod
    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        """-> (B, h * w + 1) logits; the last one is the null action's: nothing remains to be done."""

    @abstractmethod
    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        """pick: (B, 2), angles: (B, R) -> (B, R) logits of the gripper's yaw; None where there is no rotator."""

    @abstractmethod
    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        """pick: (B, 2), angles: (B, R) relative to the pick's yaw -> (B, R, h, w) logits."""

    def score_rotations(self, images: Tensor, goal: Goal, pick: Tensor) -> tuple[Tensor | None, Tensor]:
        """score_yaws and score_places at all bins, as acting asks for both: (B, k) or None, (B, k, h, w)."""
        angles = bin_angles(self.config.n_rotations, images.device).expand(len(images), -1)
        return self.score_yaws(images, goal, pick, angles), self.score_places(images, goal, pick, angles)
