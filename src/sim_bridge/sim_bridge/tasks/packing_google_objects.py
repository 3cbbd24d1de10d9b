"""packing-google-objects: everyday objects into the brown box, one by one or all of a name.

See docs/benchmark.md, "packing-google-objects-seq" and "packing-google-objects-group".
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from cliport_core import PlanarPose
from sim_bridge.errors import LayoutError
from sim_bridge.everyday import object_set
from sim_bridge.objects import Pinch, SceneObject
from sim_bridge.objects.container import WALL
from sim_bridge.task_mechanics.clearance import palm_is_free
from sim_bridge.task_mechanics.dropping import drop
from sim_bridge.task_mechanics.goal import Goal, ZoneMetric, lattice
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.pinches import gripper_at
from sim_bridge.task_mechanics.placing import place_in_container
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.box_partition import Packing, random_packing
from sim_bridge.tasks.packing_boxes import add_container
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

_SIDES = (0.20, 0.35)  # of the container [m]
_CHOICE = 2  # of a thing's pinches, that with more room for the fingers is taken
_SHORTEST = 0.08  # side of a cell that a cut leaves, with half a gap [m]


class PackingGoogleObjects(GoalTask):
    """A container (fixed), and an everyday object for each of its cells, dropped on the table where there is room."""

    done_sentence = "done packing objects."

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self._variant = variant
        self._n_targets = 0

    @property
    def object_source(self) -> str:
        """See Task."""
        return object_set().description

    @property
    def names(self) -> tuple[str, ...]:
        """Of the objects that a scene of this split may hold."""
        source = object_set()
        if self._variant is Variant.SEEN:
            return source.seen + source.unseen
        return source.seen if self.split is Split.TRAIN else source.unseen

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """See GoalTask."""
        packing = random_packing(_SIDES, _SHORTEST, lambda cell: True, rng)
        container = add_container(world, packing.width, packing.depth, rng)
        goals = self.goals_for(world, container, packing, rng)
        world.settle()
        for goal in goals:
            for thing in goal.objects:
                if not self.pinches(thing):
                    raise LayoutError(f"the {thing.name} came to lie so that nothing of it is narrow enough to be held")
        self._n_targets = sum(len(goal.objects) for goal in goals)
        return goals

    @abstractmethod
    def goals_for(
        self, world: SimWorld, container: SceneObject, packing: Packing, rng: np.random.Generator
    ) -> Sequence[Goal]:
        """Drop the objects and draw which of them are to be packed.

        Raises:
            LayoutError: when too few objects found room.
        """

    @property
    def max_steps(self) -> int:
        """One mistake is allowed."""
        return self._n_targets + 1

    def moves_to_make(self, goal: Goal) -> list[tuple[SceneObject, PlanarPose]]:
        """See GoalTask; each thing goes where there is room, as near to the container's middle as may be."""
        assert isinstance(goal.metric, ZoneMetric)
        size = goal.metric.size
        return [
            (thing, place_in_container(self.world, goal.targets[0], size, thing))
            for thing, _ in super().moves_to_make(goal)
        ]

    def pinches(self, thing: SceneObject) -> list[Pinch]:
        """The best of those where the palm has room too, if there are any."""
        pinches = super().pinches(thing)
        here = self.world.planar_pose(thing)
        free = [pinch for pinch in pinches if palm_is_free(self.world, thing, gripper_at(here, pinch))]
        return (free or pinches)[:_CHOICE]

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """The container's floor."""
        return WALL


class PackingGoogleObjectsSeq(PackingGoogleObjects):
    """Objects of different names; each step names the next one."""

    sentence_pattern = "pack the {thing} in the brown box"
    stepwise = True

    def goals_for(
        self, world: SimWorld, container: SceneObject, packing: Packing, rng: np.random.Generator
    ) -> Sequence[Goal]:
        """See PackingGoogleObjects."""
        names = [self.names[i] for i in rng.permutation(len(self.names))[: len(packing.cells)]]
        things = _dropped(world, names, packing, rng)
        if len(things) < 2:
            raise LayoutError(f"room for {len(things)} of {len(names)} objects: two are needed; use a larger workspace")
        count = int(rng.integers(1, len(things)))
        return [
            _goal(world, f"pack the {thing.name} in the brown box", [thing], container, packing, 1.0 / count)
            for thing in things[:count]
        ]


class PackingGoogleObjectsGroup(PackingGoogleObjects):
    """Two or more objects of one name are to be packed; two or more of another name, and others, are not."""

    sentence_pattern = "pack all the {thing} objects in the brown box"

    def goals_for(
        self, world: SimWorld, container: SceneObject, packing: Packing, rng: np.random.Generator
    ) -> Sequence[Goal]:
        """See PackingGoogleObjects."""
        names = [self.names[i] for i in rng.integers(len(self.names), size=len(packing.cells))]
        wanted, other = (names[i] for i in rng.choice(len(names), size=2, replace=False))
        names[:4] = [wanted, wanted, other, other]
        things = _dropped(world, names, packing, rng)
        targets = [thing for thing in things if thing.name == wanted]
        if len(targets) < 2 or len(things) < 3:
            raise LayoutError(f"room for {len(targets)} of two objects to pack; use a larger workspace")
        return (_goal(world, f"pack all the {wanted} objects in the brown box", targets, container, packing, 1.0),)


def _dropped(world: SimWorld, names: Sequence[str], packing: Packing, rng: np.random.Generator) -> list[SceneObject]:
    """One object a cell, as large as that asks for; those without room are left out."""
    source = object_set()
    edges = [max(cell.width, cell.depth) for cell in packing.cells]
    return drop(world, [(source.named(name), edge) for name, edge in zip(names, edges, strict=True)], rng)


def _goal(
    world: SimWorld,
    sentence: str,
    things: Sequence[SceneObject],
    container: SceneObject,
    packing: Packing,
    max_reward: float,
) -> Goal:
    """All points of the things inside the container's outline; the expert puts them in its middle."""
    bounds = [(thing.mesh.vertices.min(axis=0), np.ptp(thing.mesh.vertices, axis=0)) for thing in things]
    points = tuple(lattice(low, size) for low, size in bounds)
    return Goal(
        sentence,
        tuple(things),
        (world.object_pose(container),) * len(things),
        np.eye(len(things), dtype=bool),
        ZoneMetric((packing.width, packing.depth), points),
        max_reward,
        target_name=container.name,
    )
