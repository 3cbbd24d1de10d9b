"""stack-block-pyramid: six cubes on a stand, block by block or row by row.

See docs/benchmark.md, "stack-block-pyramid-seq" and "stack-block-pyramid".
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from cliport_core import Pose
from sim_bridge.objects import SceneObject, block_shape
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.objects.pyramid_stand import PYRAMID_STAND_HEIGHT, pyramid_stand_shape
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

# y in the stand's frame [m] and row of each block, bottom row first
SLOTS = ((-0.05, 0), (0.0, 0), (0.05, 0), (-0.025, 1), (0.025, 1), (0.0, 2))
_ROWS = (("bottom", ("purple", "blue", "green")), ("middle", ("yellow", "orange")), ("top", ("red",)))
_ROW_COLORS = ("green, blue and purple blocks", "yellow and orange blocks", "red block")


class _Pyramid(GoalTask):
    """Common part of both tasks: a stand and six cubes of six colours."""

    done_sentence = "done stacking block pyramid."

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the stand and the cubes, and return the goals."""
        shape = pyramid_stand_shape()
        at = free_pose(world, shape, rng, graspable=False).as_pose(PYRAMID_STAND_HEIGHT / 2)
        world.add(shape, at, fixed=True)
        blocks = []
        for color in self.colors(rng):
            pose = free_pose(world, block_shape(), rng).as_pose(BLOCK_SIZE / 2)
            blocks.append(world.add(block_shape(), pose, color))
        return self.goals_for(blocks, [at @ slot for slot in _slots()])

    @abstractmethod
    def colors(self, rng: np.random.Generator) -> Sequence[str]:
        """Return the colours of the six blocks, bottom row first."""

    @abstractmethod
    def goals_for(self, blocks: Sequence[SceneObject], slots: Sequence[Pose]) -> Sequence[Goal]:
        """Return the goals in their order; slots: poses to which the blocks go [base frame]."""

    @property
    def max_steps(self) -> int:
        """Twelve: twice as many as needed."""
        return 12

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the row below."""
        return goal.level(thing)


class StackBlockPyramidSeq(_Pyramid):
    """Variant with a sentence and a goal for each block."""

    sentence_pattern = "put the {color} block on {place}"
    stepwise = True

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)

    def colors(self, rng: np.random.Generator) -> Sequence[str]:
        """Draw six colours of the palette."""
        return tuple(str(c) for c in rng.permutation(self.palette)[: len(SLOTS)])

    def goals_for(self, blocks: Sequence[SceneObject], slots: Sequence[Pose]) -> Sequence[Goal]:
        """Return a goal for each block, a sixth of the task each."""
        c = [block.color for block in blocks]
        places = (
            "the lightest brown block",
            "the middle brown block",
            "the darkest brown block",
            f"the {c[0]} and {c[1]} blocks",
            f"the {c[1]} and {c[2]} blocks",
            f"the {c[3]} and {c[4]} blocks",
        )
        sentences = [f"put the {color} block on {place}" for color, place in zip(c, places, strict=True)]
        return [_goal(*goal) for goal in zip(sentences, zip(blocks), zip(slots), strict=True)]


class StackBlockPyramid(_Pyramid):
    """Variant with a goal for each row, whose blocks are interchangeable; the colours are always the same."""

    def colors(self, rng: np.random.Generator) -> Sequence[str]:
        """Return the rows' colours."""
        return [color for _, colors in _ROWS for color in colors]

    def goals_for(self, blocks: Sequence[SceneObject], slots: Sequence[Pose]) -> Sequence[Goal]:
        """Return a goal for each row, with as large a share of the task as the row has of the blocks."""
        goals, first = [], 0
        for (row, colors), named in zip(_ROWS, _ROW_COLORS, strict=True):
            end = first + len(colors)
            goals.append(_goal(f"make the {row} row with the {named}", blocks[first:end], slots[first:end]))
            first = end
        return goals


def _slots() -> list[Pose]:
    """Return the poses of the blocks' middles at rest, in the stand's frame."""
    heights = [PYRAMID_STAND_HEIGHT / 2 + (row + 0.5) * BLOCK_SIZE for _, row in SLOTS]
    return [Pose.from_xyz_rpy((0.0, y, z), (0.0, 0.0, 0.0)) for (y, _), z in zip(SLOTS, heights, strict=True)]


def _goal(sentence: str, blocks: Sequence[SceneObject], slots: Sequence[Pose]) -> Goal:
    n = len(blocks)
    return Goal(
        sentence,
        tuple(blocks),
        tuple(slots),
        np.ones((n, n), dtype=bool),
        PoseMetric(),
        max_reward=n / len(SLOTS),
        symmetries=(block_shape().symmetry,) * n,
    )
