"""block-insertion: an L-shaped block into the fixture of its shape.

See docs/benchmark.md, "block-insertion".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim_bridge.objects.l_block import FIXTURE_HEIGHT, L_HEIGHT, l_block_shape, l_fixture_shape
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.world import SimWorld


class BlockInsertion(GoalTask):
    """Task with a red L block and a fixed fixture into which it fits with 1 cm to spare."""

    done_sentence = "done inserting the block."

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the fixture and the block, and return the goal."""
        fixture = free_pose(world, l_fixture_shape(), rng, graspable=False)
        world.add(l_fixture_shape(), fixture.as_pose(FIXTURE_HEIGHT / 2), fixed=True)
        at = free_pose(world, l_block_shape(), rng).as_pose(L_HEIGHT / 2)
        block = world.add(l_block_shape(), at, "red")
        return (
            Goal(
                "put the L shape block in the L shape hole",
                (block,),
                (fixture.as_pose(L_HEIGHT / 2),),
                np.ones((1, 1), dtype=bool),
                PoseMetric(),
                max_reward=1.0,
                symmetries=(l_block_shape().symmetry,),
            ),
        )

    @property
    def max_steps(self) -> int:
        """Three: two mistakes are allowed."""
        return 3
