"""put-blocks-in-bowls: every block of one colour into a bowl of another colour (task specification, section 7.4)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sim_bridge.colors import COLORS
from sim_bridge.objects import SceneObject, block_shape, bowl_shape
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.objects.bowl import BOWL_HEIGHT
from sim_bridge.task_mechanics.base import ExpertAction, Split
from sim_bridge.task_mechanics.free_space import free_pose
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks.color_goal import DONE_SENTENCE, ColorGoal
from sim_bridge.tasks.variants import Variant

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

IN_BOWL = PoseMetric(position=0.05)
N_DISTRACTORS = 6


class PutBlocksInBowls(GoalTask):
    """One to three target bowls (fixed), as many or fewer target blocks, six distractors of other colours."""

    done_sentence = DONE_SENTENCE

    def __init__(self, name: str, split: Split, variant: Variant, goal: ColorGoal | None = None) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)
        self._wanted_goal = goal
        self._goal = ColorGoal(self.palette[0], self.palette[1])
        self._n_blocks = 0

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """See GoalTask."""
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
        """Of each distractor, should it be a block or should it be a bowl."""
        others = [c for c in COLORS if c not in (self._goal.block, self._goal.bowl)]
        return [(color, color) for color in others[:N_DISTRACTORS]]

    @property
    def goal(self) -> ColorGoal:
        """The episode's goal."""
        return self._goal

    @property
    def max_steps(self) -> int:
        """One mistake is allowed."""
        return self._n_blocks + 1

    def score_of(self, goal: ColorGoal) -> float:
        """Share of the blocks of the goal's colour that lie in any bowl of the goal's colour."""
        wanted = self._as_goal(goal)
        return wanted.value(self.world) if wanted.objects and wanted.targets else 0.0

    def expert_action_for(self, goal: ColorGoal) -> ExpertAction | None:
        """The next action for any goal in this scene; a bowl that holds a block is not free."""
        wanted = self._as_goal(goal)
        return self.expert_for(wanted) if wanted.objects and wanted.targets else None

    def expert_action(self) -> ExpertAction | None:
        """See Task."""
        return self.expert_action_for(self._goal)

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """The fingers open above a bowl's rim."""
        return BOWL_HEIGHT

    def goals_in_scene(self) -> list[ColorGoal]:
        """Every goal of the split's palette that this scene leaves to do, in a fixed order."""
        goals = [ColorGoal(b, c) for b in self.palette for c in self.palette if b != c]
        return [goal for goal in goals if self.expert_action_for(goal) is not None]

    def blocks(self, color: str | None = None) -> list[SceneObject]:
        """All blocks, or those of a colour."""
        return [o for o in self.objects if o.shape is block_shape() and color in (None, o.color)]

    def bowls(self, color: str | None = None) -> list[SceneObject]:
        """All bowls, or those of a colour."""
        return [o for o in self.objects if o.shape is bowl_shape() and color in (None, o.color)]

    def _as_goal(self, goal: ColorGoal) -> Goal:
        """Free bowls only, except for those that hold a block of the goal."""
        world = self.world
        blocks, bowls = self.blocks(goal.block), self.bowls(goal.bowl)
        matches = np.ones((len(blocks), len(bowls)), dtype=bool)
        for j, bowl in enumerate(bowls):
            others = [b for b in self.blocks() if b not in blocks and _distance(world, b, bowl) < IN_BOWL.position]
            matches[:, j] = not others
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
