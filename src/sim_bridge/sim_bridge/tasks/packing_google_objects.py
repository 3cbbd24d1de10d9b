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
_MAX_PINCHES = 2  # best pinches of a thing, of which the one with more clearance is taken
_SHORTEST = 0.08  # side of a cell that a cut leaves, with half a gap [m]


class PackingGoogleObjects(GoalTask):
    """Task with a fixed container, and an everyday object for each of its
    cells, dropped at free places on the table."""

    done_sentence = "done packing objects."

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self._variant = variant
        self._n_targets = 0

    @property
    def object_source(self) -> str:
        """The set of everyday objects in use, in words."""
        return object_set().description

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objects that a scene of this split may hold."""
        source = object_set()
        if self._variant is Variant.SEEN:
            return source.seen + source.unseen
        return source.seen if self.split is Split.TRAIN else source.unseen

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the container, drop the objects, and return the goals."""
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
            LayoutError: when too few objects found a free place.
        """

    @property
    def max_steps(self) -> int:
        """One more than there are objects to pack: one mistake is allowed."""
        return self._n_targets + 1

    def moves_to_make(self, goal: Goal) -> list[tuple[SceneObject, PlanarPose]]:
        """Return the moves of GoalTask with other targets: a free place as
        near to the container's middle as possible."""
        assert isinstance(goal.metric, ZoneMetric)
        size = goal.metric.size
        return [
            (thing, place_in_container(self.world, goal.targets[0], size, thing))
            for thing, _ in super().moves_to_make(goal)
        ]

    def pinches(self, thing: SceneObject) -> list[Pinch]:
        """Return the best of those pinches at which the palm is free; of all of them where it never is."""
        pinches = super().pinches(thing)
        here = self.world.planar_pose(thing)
        free = [pinch for pinch in pinches if palm_is_free(self.world, thing, gripper_at(here, pinch))]
        return (free or pinches)[:_MAX_PINCHES]

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the container's floor."""
        return WALL


class PackingGoogleObjectsSeq(PackingGoogleObjects):
    """Variant with objects of different names; each step names the next one."""

    sentence_pattern = "pack the {thing} in the brown box"
    stepwise = True

    def goals_for(
        self, world: SimWorld, container: SceneObject, packing: Packing, rng: np.random.Generator
    ) -> Sequence[Goal]:
        """Drop objects of different names and return a goal for each of the first ones."""
        names = [self.names[i] for i in rng.permutation(len(self.names))[: len(packing.cells)]]
        things = _dropped(world, names, packing, rng)
        if len(things) < 2:
            raise LayoutError(
                f"free places for {len(things)} of {len(names)} objects: two are needed; use a larger workspace"
            )
        count = int(rng.integers(1, len(things)))
        return [
            _goal(world, f"pack the {thing.name} in the brown box", [thing], container, packing, 1.0 / count)
            for thing in things[:count]
        ]


class PackingGoogleObjectsGroup(PackingGoogleObjects):
    """Variant in which two or more objects of one name are to be packed; two
    or more of another name, and others, are not."""

    sentence_pattern = "pack all the {thing} objects in the brown box"

    def goals_for(
        self, world: SimWorld, container: SceneObject, packing: Packing, rng: np.random.Generator
    ) -> Sequence[Goal]:
        """Drop objects, several of two names, and return the goal of all that have the first name."""
        names = [self.names[i] for i in rng.integers(len(self.names), size=len(packing.cells))]
        wanted, other = (names[i] for i in rng.choice(len(names), size=2, replace=False))
        names[:4] = [wanted, wanted, other, other]
        things = _dropped(world, names, packing, rng)
        targets = [thing for thing in things if thing.name == wanted]
        if len(targets) < 2 or len(things) < 3:
            raise LayoutError(f"free places for {len(targets)} of two objects to pack; use a larger workspace")
        return (_goal(world, f"pack all the {wanted} objects in the brown box", targets, container, packing, 1.0),)


def _dropped(world: SimWorld, names: Sequence[str], packing: Packing, rng: np.random.Generator) -> list[SceneObject]:
    """Drop one object for each cell, sized by that; those without a free place are left out."""
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
    """Return the goal of all points of the things inside the container's
    outline; the expert puts them in its middle."""
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
