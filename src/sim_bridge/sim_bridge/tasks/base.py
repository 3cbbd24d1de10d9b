"""What a task of the benchmark is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from cliport_perception import PlanarPose
from sim_bridge.objects import SceneObject

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld


class Split(Enum):
    """Which part of the data a scene belongs to; the order is part of every scene's seed."""

    TRAIN = "train"
    VAL = "val"
    TEST = "test"


@dataclass(frozen=True)
class ExpertAction:
    """What the expert, who knows the scene, would do next; poses in the base frame.

    pick_yaw_period: turning the gripper by this [rad] gives an equally good grasp.
    """

    pick: PlanarPose
    place: PlanarPose
    pick_yaw_period: float
    instruction: str


class Task(ABC):
    """One task's scene, goal, metric and expert, in one world."""

    name: str
    split: Split

    @abstractmethod
    def reset(self, world: SimWorld, rng: np.random.Generator) -> None:
        """Spawn the objects into an empty world and draw the goal.

        Raises:
            LayoutError: when the objects found no room.
        """

    @property
    @abstractmethod
    def instruction(self) -> str:
        """The sentence for what is to be done now; a completion phrase when nothing is."""

    @property
    @abstractmethod
    def max_steps(self) -> int:
        """How many actions an episode may take."""

    @property
    @abstractmethod
    def objects(self) -> Sequence[SceneObject]:
        """Everything that the task put on the table."""

    @abstractmethod
    def score(self) -> float:
        """How much of the goal is reached, 0..1."""

    @abstractmethod
    def expert_action(self) -> ExpertAction | None:
        """What to do next; None when nothing is left to do."""

    def done(self) -> bool:
        """Whether the goal is reached."""
        return self.score() > 0.99
