"""assembling-kits: every shape into any print that fits it, in any order.

See docs/benchmark.md, "assembling-kits".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.tasks.kit_task import KitTask, kit_shapes_of
from sim_bridge.world import SimWorld

_COLORS = ("purple", "blue", "green", "yellow", "red")


class AssemblingKits(KitTask):
    """Five shapes, always of the same five colours, and one goal."""

    @property
    def max_steps(self) -> int:
        """Twice the number of shapes: a mistake for each is allowed."""
        return 2 * len(_COLORS)

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the kit and its shapes, and return the goal."""
        fits = self.spawn(world, rng, _COLORS, kit_shapes_of(self.split))
        goal = Goal(
            "put all the blocks inside the holes they fit in",
            tuple(fit.thing for fit in fits),
            tuple(fit.hole_pose for fit in fits),
            np.array([[thing.index == hole.index for hole in fits] for thing in fits]),
            PoseMetric(),
            max_reward=1.0,
            symmetries=tuple(fit.period for fit in fits),
            target_name="hole",
        )
        return (goal,)
