"""towers-of-hanoi: three rings from the first peg to the last, a sentence a move or one for all.

See docs/benchmark.md, "towers-of-hanoi-seq" and "towers-of-hanoi".
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

import numpy as np

from cliport_core import Pose
from sim_bridge.objects import SceneObject
from sim_bridge.objects.hanoi import (
    HANOI_STAND_HEIGHT,
    HANOI_TILE,
    RING_DIAMETERS,
    RING_THICKNESS,
    hanoi_stand_shape,
    ring_shape,
)
from sim_bridge.task_mechanics.goal import Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.placing import free_outline_pose
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

PEGS = ("lighter brown side", "middle of the stand", "darker brown side")
PLAN = ((0, 2), (1, 1), (0, 1), (2, 2), (0, 0), (1, 2), (0, 2))  # (ring, peg) a move; ring 0 is the smallest


class _Hanoi(GoalTask):
    """Common part of both tasks: a stand with three pegs and, on the first one, three rings."""

    done_sentence = "solved towers of hanoi."

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the stand and the rings, and return a goal for each move."""
        shape = hanoi_stand_shape()
        at = free_outline_pose(world, shape, rng, clearance=0.0).as_pose(HANOI_STAND_HEIGHT / 2)
        world.add(shape, at, fixed=True)
        count = len(RING_DIAMETERS)
        rings = [
            world.add(ring_shape(diameter), at @ _on_peg(0, count - 1 - i), color)
            for i, (diameter, color) in enumerate(zip(RING_DIAMETERS, self.colors(rng), strict=True))
        ]
        pegs = [list(reversed(range(count))), [], []]
        goals = []
        for ring, peg in PLAN:
            for rings_there in pegs:
                if ring in rings_there:
                    rings_there.remove(ring)
            target = at @ _on_peg(peg, len(pegs[peg]))
            pegs[peg].append(ring)
            goals.append(_goal(self.sentence(rings[ring], peg), rings[ring], target))
        return goals

    @abstractmethod
    def colors(self, rng: np.random.Generator) -> Sequence[str]:
        """Return the colours of the three rings, the smallest first."""

    @abstractmethod
    def sentence(self, ring: SceneObject, peg: int) -> str:
        """Return the sentence that asks for a move."""

    @property
    def max_steps(self) -> int:
        """Twice as many as needed."""
        return 2 * len(PLAN)

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the tile, or of the ring that is on the peg already."""
        return goal.level(thing)


class TowersOfHanoiSeq(_Hanoi):
    """Variant with a sentence for every move."""

    sentence_pattern = "move the {color} ring to the {peg}"
    stepwise = True

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)

    def colors(self, rng: np.random.Generator) -> Sequence[str]:
        """Draw three colours of the palette."""
        return tuple(str(c) for c in rng.permutation(self.palette)[: len(RING_DIAMETERS)])

    def sentence(self, ring: SceneObject, peg: int) -> str:
        """Return a sentence with the ring's colour and the peg."""
        return f"move the {ring.color} ring to the {PEGS[peg]}"


class TowersOfHanoi(_Hanoi):
    """Variant with one sentence; the colours are always the same."""

    def colors(self, rng: np.random.Generator) -> Sequence[str]:
        """Return the colours from small to large."""
        return ("red", "yellow", "green")

    def sentence(self, ring: SceneObject, peg: int) -> str:
        """Return the sentence, the same for every move."""
        return "solve towers of hanoi"


def _on_peg(peg: int, below: int) -> Pose:
    """Return the pose of a ring's middle with `below` rings under it, in the stand's frame."""
    z = HANOI_STAND_HEIGHT / 2 + (below + 0.5) * RING_THICKNESS
    return Pose.from_xyz_rpy((0.0, (peg - 1) * HANOI_TILE, z), (0.0, 0.0, 0.0))


def _goal(sentence: str, ring: SceneObject, target: Pose) -> Goal:
    return Goal(
        sentence,
        (ring,),
        (target,),
        np.ones((1, 1), dtype=bool),
        PoseMetric(),
        max_reward=1.0 / len(PLAN),
        symmetries=(0.0,),
        turn=False,
    )
