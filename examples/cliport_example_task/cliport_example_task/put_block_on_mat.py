"""put-block-on-mat: one of two blocks onto one of two mats, by their colours."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from sim_bridge.colors import COLORS
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.objects import SceneObject, Shape, block_shape
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.world import SimWorld

MAT_SIZE = (0.12, 0.12, 0.002)  # [m]
ON_MAT = PoseMetric(position=0.04)  # of the block's middle from the mat's


class PutBlockOnMat(GoalTask):
    """Two blocks and two mats of four colours; the mats are only seen and do not move."""

    done_sentence = "done putting the block on the mat."
    max_steps = 2  # one mistake is allowed
    several_goals = True
    sentence_pattern = "put the {block} block on the {mat} mat"
    _pairs: tuple[tuple[SceneObject, SceneObject], ...] = ()

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """See GoalTask."""
        colors = [str(color) for color in rng.permutation(list(COLORS))[:4]]
        mats = [
            world.add(mat_shape(), free_pose(world, mat_shape(), rng, graspable=False).as_pose(), color, fixed=True)
            for color in colors[:2]
        ]
        blocks = [
            world.add(block_shape(), free_pose(world, block_shape(), rng).as_pose(BLOCK_SIZE / 2), color)
            for color in colors[2:]
        ]
        self._pairs = tuple((block, mat) for block in blocks for mat in mats)
        return (self._goal(world, *self._pairs[0]),)

    @property
    def sentence_slots(self) -> Mapping[str, str]:
        """The two colours."""
        block, mat = self._pairs[0]
        return {"block": block.color, "mat": mat.color}

    def goals_in_scene(self) -> Sequence[Goal]:
        """See Task: each block onto each mat."""
        goals = [self._goal(self.world, block, mat) for block, mat in self._pairs]
        return [goal for goal in goals if self.expert_action_for(goal) is not None]

    def chance_score(self, rng: np.random.Generator) -> float:
        """See Task: in each step one of the pairs of a block and a mat is right."""
        return 1.0 - (1.0 - 1.0 / len(self._pairs)) ** self.max_steps

    def _goal(self, world: SimWorld, block: SceneObject, mat: SceneObject) -> Goal:
        return Goal(
            self.sentence_pattern.format(block=block.color, mat=mat.color),
            objects=(block,),
            targets=(world.object_pose(mat),),
            matches=np.ones((1, 1), dtype=bool),
            metric=ON_MAT,
            max_reward=1.0,
            symmetries=(0.0,),
            turn=False,
            target_name="mat",
        )


@lru_cache(maxsize=1)
def mat_shape() -> Shape:
    """A thin square, only seen; its frame on the table."""
    return Shape("mat", TriangleMesh.box(MAT_SIZE), None, mass=0.0, symmetry=math.pi / 2)
