"""What a task of the benchmark is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from cliport_perception import PlanarPose, Primitive
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
    primitive: Primitive = Primitive.PICK_PLACE


@dataclass(frozen=True)
class Choice:
    """What two poses mean in a scene: what is picked and what it is placed at ("" for nothing), and whether each
    is what the present goal asks for."""

    picked: str
    place: str
    pick_right: bool
    place_right: bool


class Task(ABC):
    """One task's scene, goals, metric and expert, in one world.

    primitive: what the hand does with two poses here.
    """

    name: str
    split: Split
    primitive: Primitive = Primitive.PICK_PLACE

    @abstractmethod
    def reset(self, world: SimWorld, rng: np.random.Generator) -> None:
        """Spawn the objects into an empty world and draw the goals; rng draws everything.

        Raises:
            LayoutError: when the objects found no room; the caller tries again in an empty world.
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
        """How much of the whole task is reached now, 0..1; changes nothing."""

    @abstractmethod
    def advance(self) -> None:
        """Judge the scene after an action: when the present goal is reached, the next one becomes present."""

    @abstractmethod
    def expert_action(self) -> ExpertAction | None:
        """What to do next; None when nothing is left to do, or nothing can be done."""

    @abstractmethod
    def judge(self, pick: PlanarPose, place: PlanarPose) -> Choice:
        """What an action with these poses would mean, before it is carried out."""

    @property
    def object_source(self) -> str:
        """Which set of everyday objects the scenes are made of; "" for a task without any.

        Raises:
            ObjectFolderError: when the set cannot be used.
        """
        return ""

    @property
    def goals_reached(self) -> int:
        """How many of the goals were reached, one after another."""
        return int(self.done())

    def done(self) -> bool:
        """Whether the whole task is reached."""
        return self.score() > 0.99
