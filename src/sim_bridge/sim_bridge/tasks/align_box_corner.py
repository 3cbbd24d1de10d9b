"""align-box-corner: a box of any size onto the corner that is marked for it.

See docs/benchmark.md, "align-box-corner".
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cliport_core import Pose
from sim_bridge.colors import random_brown
from sim_bridge.objects import cuboid
from sim_bridge.objects.block import BOX_MASS, WIDEST_PINCH
from sim_bridge.objects.corner import corner_shape
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.world import SimWorld

SIDES = (0.05, 0.15)  # [m]
HEIGHTS = (0.01, 0.06)  # [m]


class AlignBoxCorner(GoalTask):
    """Task with one goal: the box lies in the corner in any of four ways,
    either side along either strip, either way round."""

    done_sentence = "done aligning the box."

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the corner and the box, and return the goal."""
        x, y, z = _box_size(rng)
        shape = cuboid("box", (x, y, z), BOX_MASS)
        corner = free_pose(world, shape, rng).as_pose()
        world.add(corner_shape(x, y), corner, fixed=True)
        box = world.add(shape, free_pose(world, shape, rng).as_pose(z / 2), paint=random_brown(rng))
        quarter = ((x - y) / 2, (y - x) / 2)
        places = [(0.0, 0.0, 0.0), (0.0, 0.0, math.pi), (*quarter, math.pi / 2), (*quarter, -math.pi / 2)]
        targets = [corner @ Pose.from_xyz_rpy((dx, dy, z / 2), (0.0, 0.0, yaw)) for dx, dy, yaw in places]
        return (
            Goal(
                "align the brown box with the green corner",
                (box,),
                tuple(targets),
                np.ones((1, len(targets)), dtype=bool),
                PoseMetric(),
                max_reward=1.0,
                symmetries=(math.tau,),
            ),
        )

    @property
    def max_steps(self) -> int:
        """Three: two mistakes are allowed."""
        return 3


def _box_size(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw edges (x, y, z) [m] until the hand spans one side."""
    while True:
        x, y = rng.uniform(*SIDES, 2)
        if min(x, y) <= WIDEST_PINCH:
            return float(x), float(y), float(rng.uniform(*HEIGHTS))
