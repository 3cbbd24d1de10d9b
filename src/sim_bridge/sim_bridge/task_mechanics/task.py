"""Interface of a task of the benchmark."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from cliport_core import PickPlaceAction, PlanarPose, Primitive
from sim_bridge.errors import GoalError
from sim_bridge.objects import SceneObject
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.world import SimWorld

DONE_ABOVE = 0.99  # a task with a higher score is done


class Split(Enum):
    """Part of the data that a scene belongs to; the order is part of every scene's seed."""

    TRAIN = "train"
    VAL = "val"
    TEST = "test"


@dataclass(frozen=True)
class JudgedAction:
    """Meaning of an action in a scene: the names of the thing picked and of the thing it is placed at ("" for nothing),
    and whether each is right for the present goal."""

    picked: str
    place: str
    pick_right: bool
    place_right: bool


class Task(ABC):
    """One task's scene, goals, metric and expert, in one world.

    primitive: what the hand does with two poses here.
    redraws: how many scenes were drawn in vain before this one: a thing found no free place, or things flew apart.
    stepwise: whether each sentence asks for one action only; else it asks for all that is left to do.
    knows_mistakes: whether `mistake` has anything to return.
    several_goals: whether one scene may serve several goals, which `goals_in_scene` lists.
    sentence_pattern: the sentence with {slots} for `sentence_slots`, where it may be reworded; "" where it may not.
    """

    name: str
    split: Split
    primitive: Primitive = Primitive.PICK_PLACE
    redraws: int = 0
    stepwise: bool = False
    knows_mistakes: bool = False
    several_goals: bool = False
    sentence_pattern: str = ""

    def ask_for(self, instruction: str) -> None:
        """Have the scenes to come made for the goal that a sentence names; before `reset`.

        Raises:
            GoalError: when the sentence names no goal, or the task makes no scenes for chosen ones.
        """
        raise GoalError(f"{self.name} makes no scene for a chosen sentence; leave the instruction empty")

    @abstractmethod
    def reset(self, world: SimWorld, rng: np.random.Generator) -> None:
        """Spawn the objects into an empty world and draw the goals; rng draws everything.

        Raises:
            LayoutError: when an object found no free place; the caller tries again in an empty world.
        """

    @property
    @abstractmethod
    def instruction(self) -> str:
        """The sentence for what is to be done now; a completion phrase when nothing is."""

    @property
    def sentences_done(self) -> Sequence[str]:
        """Sentences of goals that were reached before and still are, the last first; not the present `instruction`."""
        return ()

    @property
    @abstractmethod
    def max_steps(self) -> int:
        """Number of actions that an episode may take."""

    @property
    @abstractmethod
    def objects(self) -> Sequence[SceneObject]:
        """Everything that the task put on the table."""

    @abstractmethod
    def score(self) -> float:
        """Score the last action, 0..1; before the first one, the scene as it is. Changes nothing."""

    def score_with_next(self) -> float:
        """Return the score, 0..1, with the next goal counted as far as it is fulfilled without an action."""
        return self.score()

    @abstractmethod
    def advance(self) -> None:
        """Judge the scene, once after each action: keep its score, then, when the
        present goal is reached, make the next one present."""

    @abstractmethod
    def expert_action(self) -> PickPlaceAction | None:
        """Return the next action for `instruction`; None when nothing is left to do, or nothing can be done."""

    @abstractmethod
    def judge(self, pick: PlanarPose, place: PlanarPose, exact_offset: bool = False) -> JudgedAction:
        """Judge an action with these poses before it is carried out.

        exact_offset: whether the hand places a thing as far off as it was picked, instead of centring its grasp.
        """

    def goals_in_scene(self) -> Sequence[Goal]:
        """Return every goal that this scene leaves to do, the present one among them, in a fixed order.

        Empty for a task whose scenes are made for one goal.
        """
        return ()

    def goals_without_words(self) -> Sequence[Goal]:
        """Return every goal that some sentence might ask for in this scene, as
        someone knows who does not hear the sentence.

        Empty for a task that does not say.
        """
        return ()

    @abstractmethod
    def expert_action_for(self, goal: Goal) -> PickPlaceAction | None:
        """Return what brings a goal of this scene nearer; None when all its objects lie right."""

    def mistake(self, rng: np.random.Generator) -> PickPlaceAction | None:
        """Return an action that does the present goal wrong and can be put right; None where there is none.

        The expert's next action is the one that puts it right.
        """
        return None

    def chance_score(self, rng: np.random.Generator) -> float | None:
        """Return the mean score, 0..1, of an agent that moves the right kind of thing but chooses at random.

        Changes nothing; rng draws the choices. None where that is not known.
        """
        return None

    @property
    def sentence_slots(self) -> Mapping[str, str]:
        """The words of each slot of `sentence_pattern` in the present sentence; empty where it has another form."""
        pattern = re.sub(r"\\{(\w+)\\}", r"(?P<\1>.+?)", re.escape(self.sentence_pattern))
        match = re.fullmatch(pattern, self.instruction)
        return match.groupdict() if match else {}

    @property
    def object_source(self) -> str:
        """The set of everyday objects that the scenes are made of, in words; "" for a task without any.

        Raises:
            ObjectFolderError: when the set cannot be used.
        """
        return ""

    @property
    def goals_reached(self) -> int:
        """Number of the goals that were reached, one after another."""
        return int(self.done())

    def done(self) -> bool:
        """Return True if the whole task is reached."""
        return self.score() > DONE_ABOVE
