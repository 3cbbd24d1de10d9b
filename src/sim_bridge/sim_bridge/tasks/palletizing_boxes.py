"""palletizing-boxes: eighteen boxes, one after the other, onto a pallet.

See docs/benchmark.md, "palletizing-boxes".
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from cliport_core import PlanarPose, Pose
from sim_bridge.colors import random_brown
from sim_bridge.objects import SceneObject, Shape, cuboid
from sim_bridge.objects.block import BOX_MASS
from sim_bridge.objects.pallet import PALLET_SIZE, pallet_shape
from sim_bridge.robot import HAND
from sim_bridge.task_mechanics.goal import Goal, PoseMetric, ZoneMetric, lattice
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.task import Split
from sim_bridge.world import SimWorld

BOX_SIZE = (0.09, 0.0567, 0.0567)  # [m]
LAYERS = 3
GAP = 0.01  # between the ends of boxes [m]
FINGER_GAP = HAND.finger_thickness + 0.0098  # between the sides by which boxes are held, with a margin [m]
BOXES_FROM = PlanarPose(0.45, -0.25, 0.0)  # where they appear, with any yaw
PALLET_AT = PlanarPose(0.45, 0.25, 0.0)
_SENTENCE = "stack all the boxes on the pallet"


class PalletizingBoxes(GoalTask):
    """Task in which a box appears whenever none lies on the half of the table at y < 0; they make three layers of six,
    each turned by a quarter against the one below."""

    done_sentence = "done stacking the boxes."

    def __init__(self, name: str, split: Split) -> None:
        super().__init__(name, split)
        self._slots: list[Pose] = []
        self._coming: list[tuple[PlanarPose, tuple[int, int, int]]] = []
        self._boxes: list[SceneObject] = []

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the pallet and the first box, and return the goal."""
        world.add(pallet_shape(), PALLET_AT.as_pose(PALLET_SIZE[2] / 2), fixed=True)
        layers = [_layer(i) for i in range(LAYERS)]
        self._slots = [layer[i] for layer in layers for i in rng.permutation(len(layer))]
        yaws = rng.uniform(-math.pi, math.pi, len(self._slots))
        at = [PlanarPose(BOXES_FROM.x, BOXES_FROM.y, float(yaw)) for yaw in yaws]
        self._coming = [(pose, random_brown(rng)) for pose in at]
        self._boxes = []
        self._bring_box(world)
        return (self._goal(),)

    @property
    def arrivals(self) -> Sequence[tuple[PlanarPose, float]]:
        """The place where boxes appear, with a box's radius."""
        return ((BOXES_FROM, math.hypot(*BOX_SIZE[:2]) / 2),)

    @property
    def max_steps(self) -> int:
        """Twelve more than there are boxes."""
        return 30

    def advance(self) -> None:
        """Judge the scene after an action, and bring the next box when the last one is away."""
        if not self._coming:
            super().advance()
            return
        self.keep_score()
        self.note_what_moved()
        if not any(self.world.object_xy(box)[1] < 0.0 for box in self._boxes):
            self._bring_box(self.world)
            self._goals = (self._goal(),)

    def moves_to_make(self, goal: Goal) -> list[tuple[SceneObject, PlanarPose]]:
        """Return the moves of every box to its own place on the pallet."""
        return super().moves_to_make(self._stack())

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height of the layer below."""
        return self._stack().level(thing)

    def _bring_box(self, world: SimWorld) -> None:
        at, paint = self._coming.pop(0)
        self._boxes.append(world.add(_box(), at.as_pose(BOX_SIZE[2] / 2), paint=paint))

    def _goal(self) -> Goal:
        """Return the goal that is scored: every box spawned so far is on the
        pallet; its share of the task grows with them."""
        n = len(self._boxes)
        points = lattice([-side / 2 for side in BOX_SIZE], BOX_SIZE)
        return Goal(
            _SENTENCE,
            tuple(self._boxes),
            (PALLET_AT.as_pose(PALLET_SIZE[2] / 2),),
            np.ones((n, 1), dtype=bool),
            ZoneMetric(PALLET_SIZE[:2], (points,) * n),
            max_reward=n / len(self._slots),
        )

    def _stack(self) -> Goal:
        """Return the goal that the expert works for: each box at its own place."""
        n = len(self._boxes)
        slots = tuple(self._slots[:n])
        turn = (_box().symmetry,) * n
        return Goal(_SENTENCE, tuple(self._boxes), slots, np.eye(n, dtype=bool), PoseMetric(), 1.0, turn)


@lru_cache(maxsize=1)
def _box() -> Shape:
    return cuboid("box", BOX_SIZE, BOX_MASS)


def _layer(index: int) -> list[Pose]:
    """Return the poses of a layer's boxes at rest: two by three, turned by a quarter in every other layer."""
    z = PALLET_SIZE[2] + (index + 0.5) * BOX_SIZE[2]
    along, beside = BOX_SIZE[0] + GAP, BOX_SIZE[1] + FINGER_GAP
    pallet = PALLET_AT.as_pose() @ Pose.from_xyz_rpy((0.0, 0.0, z), (0.0, 0.0, index % 2 * math.pi / 2))
    places = itertools.product((-0.5, 0.5), (-1.0, 0.0, 1.0))
    return [pallet @ Pose.from_xyz_rpy((i * along, j * beside, 0.0), (0.0, 0.0, 0.0)) for i, j in places]
