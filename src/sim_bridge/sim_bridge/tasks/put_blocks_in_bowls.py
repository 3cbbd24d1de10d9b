"""put-blocks-in-bowls: every block of one colour into a bowl of another colour.

See docs/benchmark.md, "put-blocks-in-bowls".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cliport_core import PickPlaceAction
from sim_bridge.colors import COLORS
from sim_bridge.objects import SceneObject, block_shape, bowl_shape
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.objects.bowl import BOWL_HEIGHT
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.color_goal import DONE_SENTENCE, PATTERN, ColorGoal
from sim_bridge.tasks.goal_words import goal_colors
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

IN_BOWL = PoseMetric(position=0.05)
N_DISTRACTORS = 6
_CHANCE_EPISODES = 400  # that an agent without knowledge plays


class PutBlocksInBowls(GoalTask):
    """Task with one to three fixed target bowls, as many or fewer target
    blocks, and six distractors of other colours."""

    done_sentence = DONE_SENTENCE
    several_goals = True
    sentence_pattern = PATTERN

    def __init__(self, name: str, split: Split, variant: Variant, goal: ColorGoal | None = None) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)
        self._wanted_goal = goal
        self._goal = ColorGoal(self.palette[0], self.palette[1])
        self._n_blocks = 0

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create bowls, blocks and distractors, and return the goal."""
        n_bowls = int(rng.integers(1, 4))
        self._n_blocks = int(rng.integers(1, n_bowls + 1))
        first, second = rng.choice(len(self.palette), size=2, replace=False)
        self._goal = self._wanted_goal or ColorGoal(self.palette[first], self.palette[second])
        for _ in range(n_bowls):
            _add_bowl(world, self._goal.bowl, rng, fixed=True)
        for _ in range(self._n_blocks):
            _add_block(world, self._goal.block, rng)
        for block_color, bowl_color in self.distractor_colors(rng):
            if rng.random() < 0.5:
                _add_block(world, block_color, rng)
            else:
                _add_bowl(world, bowl_color, rng, fixed=False)
        return (self._as_goal(self._goal),)

    def distractor_colors(self, rng: np.random.Generator) -> list[tuple[str, str]]:
        """Return (block colour, bowl colour) of each distractor: the first if
        it becomes a block, the second if a bowl."""
        others = [c for c in COLORS if c not in (self._goal.block, self._goal.bowl)]
        return [(color, color) for color in others[:N_DISTRACTORS]]

    def ask_for(self, instruction: str) -> None:
        """Take the goal of a sentence that names a block colour and a bowl colour."""
        self._wanted_goal = goal_colors(instruction)

    @property
    def goal(self) -> ColorGoal:
        """The episode's goal."""
        return self._goal

    @property
    def sentence_slots(self) -> Mapping[str, str]:
        """The colours of the goal's blocks and bowls."""
        return {"block": self._goal.block, "bowl": self._goal.bowl}

    @property
    def max_steps(self) -> int:
        """One more than there are target blocks: one mistake is allowed."""
        return self._n_blocks + 1

    def expert_action(self) -> PickPlaceAction | None:
        """Return the expert's action; a bowl that holds a block is not free."""
        return self.expert_action_for(self._into_free_bowls(self._goal))

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of a bowl's rim, above which the fingers open."""
        return BOWL_HEIGHT

    def goals_in_scene(self) -> list[Goal]:
        """Return the goals of the split's palette that this scene leaves to do."""
        pairs = [ColorGoal(b, c) for b in self.palette for c in self.palette if b != c]
        goals = [goal for goal in map(self._into_free_bowls, pairs) if goal.objects and goal.targets]
        return [goal for goal in goals if self.expert_action_for(goal) is not None]

    def chance_score(self, rng: np.random.Generator) -> float:
        """Return the mean score, 0..1, of an agent that never fails to move a block, but chooses at random.

        Each step moves one of the blocks, wherever it lies, into one of the bowls; as in an evaluation, the
        episode ends early when the goal is reached.
        """
        is_target = np.array([block.color == self.goal.block for block in self.blocks()])
        is_goal = np.array([bowl.color == self.goal.bowl for bowl in self.bowls()])
        inside = np.zeros((_CHANCE_EPISODES, len(is_target)), dtype=bool)
        for _ in range(self.max_steps):
            going = ~inside[:, is_target].all(axis=1)
            block = rng.integers(len(is_target), size=_CHANCE_EPISODES)
            bowl = rng.integers(len(is_goal), size=_CHANCE_EPISODES)
            inside[going, block[going]] = is_goal[bowl[going]]
        return float(inside[:, is_target].mean())

    def blocks(self, color: str | None = None) -> list[SceneObject]:
        """Return all blocks, or those of a colour."""
        return [o for o in self.objects if o.shape is block_shape() and color in (None, o.color)]

    def bowls(self, color: str | None = None) -> list[SceneObject]:
        """Return all bowls, or those of a colour."""
        return [o for o in self.objects if o.shape is bowl_shape() and color in (None, o.color)]

    def goals_without_words(self) -> Sequence[Goal]:
        """Return one goal: any block in any bowl."""
        blocks, bowls = self.blocks(), self.bowls()
        matches = np.ones((len(blocks), len(bowls)), dtype=bool)
        targets = tuple(self.world.object_pose(bowl) for bowl in bowls)
        return [Goal("", tuple(blocks), targets, matches, IN_BOWL, 1.0, (0.0,) * len(blocks), turn=False)]

    def _into_free_bowls(self, goal: ColorGoal) -> Goal:
        """Return the goal that the expert works for: no bowl with a block that does not belong there."""
        wanted = self._as_goal(goal)
        matches = wanted.matches.copy()
        for j, bowl in enumerate(self.bowls(goal.bowl)):
            others = [b for b in self.blocks() if b not in wanted.objects]
            if any(_distance(self.world, other, bowl) < IN_BOWL.position for other in others):
                matches[:, j] = False
        return replace(wanted, matches=matches)

    def _as_goal(self, goal: ColorGoal) -> Goal:
        """Return the goal of any block of the one colour in any bowl of the other, whatever else is in it."""
        world = self.world
        blocks, bowls = self.blocks(goal.block), self.bowls(goal.bowl)
        matches = np.ones((len(blocks), len(bowls)), dtype=bool)
        return Goal(
            goal.sentence,
            tuple(blocks),
            tuple(world.object_pose(bowl) for bowl in bowls),
            matches,
            IN_BOWL,
            max_reward=1.0,
            symmetries=(0.0,) * len(blocks),
            turn=False,
        )


def _add_block(world: SimWorld, color: str, rng: np.random.Generator) -> None:
    world.add(block_shape(), free_pose(world, block_shape(), rng).as_pose(BLOCK_SIZE / 2), color)


def _add_bowl(world: SimWorld, color: str, rng: np.random.Generator, fixed: bool) -> None:
    at = free_pose(world, bowl_shape(), rng, graspable=False)
    world.add(bowl_shape(), at.as_pose(BOWL_HEIGHT / 2), color, fixed=fixed)


def _distance(world: SimWorld, first: SceneObject, second: SceneObject) -> float:
    return math.hypot(*(world.object_xy(first) - world.object_xy(second)))
