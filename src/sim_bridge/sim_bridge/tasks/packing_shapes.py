"""packing-unseen-shapes: one named shape into the brown box, in one action.

See docs/benchmark.md, "packing-unseen-shapes".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim_bridge.objects import SceneObject, container_shape
from sim_bridge.objects.container import CONTAINER_HEIGHT, WALL
from sim_bridge.objects.kit_shapes import THICKNESS, kit_shape
from sim_bridge.task_mechanics.goal import Goal, ZoneMetric, lattice
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_pose
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.kit_task import kit_shapes_of
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

N_SHAPES = 5


class PackingShapes(GoalTask):
    """Task with five different shapes of five colours, the first of which is asked for, and a fixed container."""

    sentence_pattern = "pack the {thing} in the brown box"
    done_sentence = "done packing shapes."

    def __init__(self, name: str, split: Split) -> None:
        super().__init__(name, split)
        self.palette = Variant.UNSEEN.palette(split)

    @property
    def max_steps(self) -> int:
        """One: there is no second try."""
        return 1

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the container and the shapes, and return the goal."""
        width, depth = rng.uniform(0.10, 0.15, size=2)
        indices = rng.choice(kit_shapes_of(self.split), size=N_SHAPES, replace=False)
        colors = rng.permutation(self.palette)[:N_SHAPES]
        container = container_shape(float(width), float(depth))
        at = free_pose(world, container, rng, graspable=False).as_pose(CONTAINER_HEIGHT / 2)
        box = world.add(container, at, fixed=True)
        things = []
        for index, color in zip(indices, colors, strict=True):
            shape = kit_shape(int(index))
            things.append(world.add(shape, free_pose(world, shape, rng).as_pose(THICKNESS / 2), str(color)))
        goal = Goal(
            f"pack the {things[0].name} in the brown box",
            (things[0],),
            (at,),
            np.ones((1, 1), dtype=bool),
            ZoneMetric((float(width), float(depth)), (_MIDDLE,)),
            max_reward=1.0,
            symmetries=(0.0,),
            target_name=box.name,
        )
        return (goal,)

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the container's floor."""
        return WALL


# the benchmark looks at one point only, next to the shape's middle
_MIDDLE = lattice((-0.0015, -0.0015, -THICKNESS / 2), (0.003, 0.003, 0.001))
