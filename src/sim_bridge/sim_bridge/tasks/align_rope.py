"""align-rope and manipulating-rope: a rope onto one side of a square.

See docs/benchmark.md, "align-rope" and "manipulating-rope".
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cliport_core import PickPlaceAction, PlanarPose, Pose, Primitive
from sim_bridge.errors import LayoutError
from sim_bridge.objects import SceneObject
from sim_bridge.objects.corner import PURE_GREEN
from sim_bridge.objects.rope import (
    ROPE_BEADS,
    SQUARE_SIDE,
    bead_shape,
    link_beads,
    square_shape,
    standing_chain,
)
from sim_bridge.sleeping import let_sleep
from sim_bridge.task_mechanics.folding import fold_to, next_fold
from sim_bridge.task_mechanics.goal import FloatArray, Goal, PoseMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.task_mechanics.task import Split
from sim_bridge.world import SimWorld

ON_SLOT = PoseMetric(position=0.02)
# the square's corners, in halves of its side, at which a rope begins and ends, and what the sentence calls it
SIDES: tuple[tuple[tuple[float, float], tuple[float, float], str], ...] = (
    ((1, 1), (-1, 1), "front left tip to front right tip"),
    ((1, 1), (1, -1), "front right tip to back right corner"),
    ((-1, 1), (-1, -1), "front left tip to back left corner"),
    ((1, -1), (-1, -1), "back right corner to back left corner"),
)

_FALL = 1.0  # simulated time for the rope to come to rest [s]
_FOOTPRINT = 0.1 * math.sqrt(0.5)  # from where the rope falls to the square's sides and the workspace's edge [m]
_SQUARE_BORDER = 0.01  # between the square's corners and the workspace's edge [m]
_ROPE_BORDER = 0.015  # between a bead and the workspace's edge [m]
_DRAWS = 200  # of a pose, at most


class AlignRope(GoalTask):
    """Task with a rope of 20 beads beside a square without front side; the
    rope goes onto one side, either way round."""

    sentence_pattern = "align the rope from {begin} to {end}"
    done_sentence = "done aligning the rope."
    primitive = Primitive.FOLD
    knows_mistakes = True
    sides_without_words: Sequence[int] = range(len(SIDES))  # that may be asked for

    def __init__(self, name: str, split: Split) -> None:
        super().__init__(name, split)
        self.beads: tuple[SceneObject, ...] = ()

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the square, drop the rope, and return the goal."""
        square = _square_pose(world, rng)
        world.add(square_shape(), square, paint=PURE_GREEN, fixed=True)
        self.beads = _drop_rope(world, square, rng)
        return (self.goal(square, self.side(rng)),)

    def side(self, rng: np.random.Generator) -> int:
        """Draw the index in SIDES that is asked for."""
        return int(rng.integers(len(SIDES)))

    def sentence(self, side: int) -> str:
        """Return the sentence for a side."""
        return f"align the rope from {SIDES[side][2]}"

    def goal(self, square: Pose, side: int) -> Goal:
        """Return the goal of a side: each bead is in its slot on that side of the square, counted from either end."""
        begin, end = (np.array([*corner, 0.0]) * (SQUARE_SIDE / 2) for corner in SIDES[side][:2])
        slots = square.apply(begin + (np.arange(ROPE_BEADS)[:, None] + 0.5) / ROPE_BEADS * (end - begin))
        either_way = np.eye(ROPE_BEADS, dtype=bool) | np.eye(ROPE_BEADS, dtype=bool)[::-1]
        targets = tuple(Pose(square.rotation, slot) for slot in slots)
        return Goal(self.sentence(side), self.beads, targets, either_way, ON_SLOT, max_reward=1.0, turn=False)

    def goals_without_words(self) -> Sequence[Goal]:
        """Return the goals of all sides that may be asked for."""
        square = next(self.world.object_pose(thing) for thing in self.objects if thing.shape is square_shape())
        return [self.goal(square, side) for side in self.sides_without_words]

    @property
    def max_steps(self) -> int:
        """One action for each bead."""
        return ROPE_BEADS

    def expert_action_for(self, goal: Goal) -> PickPlaceAction | None:
        """Return the drag of one bead to its slot, with the rest of the rope behind it."""
        beads, slots = self._beads_and_slots(goal)
        in_vain = np.array([self.tries_in_vain(bead) for bead in goal.objects])
        chosen, action = next_fold(beads, slots, in_vain)
        if action is not None:
            self.propose(goal.objects[chosen])
        return action

    def mistake(self, rng: np.random.Generator) -> PickPlaceAction | None:
        """Return the drag of any bead to the first or the last slot."""
        goal = self.present_goal
        if goal is None or self.done():
            return None
        beads, slots = self._beads_and_slots(goal)
        return fold_to(beads, int(rng.integers(ROPE_BEADS)), slots, int(rng.choice((0, ROPE_BEADS - 1))))

    def _beads_and_slots(self, goal: Goal) -> tuple[FloatArray, FloatArray]:
        beads = np.array([self.world.object_xy(bead) for bead in goal.objects])
        return beads, np.array([target.translation[:2] for target in goal.targets])


class ManipulatingRope(AlignRope):
    """Variant in which the rope always closes the square."""

    sentence_pattern = ""
    done_sentence = "done manipulating the rope."
    sides_without_words = (0,)

    def side(self, rng: np.random.Generator) -> int:
        """Return the index of the missing side."""
        return 0

    def sentence(self, side: int) -> str:
        """Return the only sentence."""
        return "manipulate the rope to complete the square"


def _square_pose(world: SimWorld, rng: np.random.Generator) -> Pose:
    """Draw a place and yaw at which all of the square lies within the workspace."""
    workspace = world.config.workspace
    for _ in range(_DRAWS):
        x = float(rng.uniform(workspace.x_min, workspace.x_max))
        y = float(rng.uniform(workspace.y_min, workspace.y_max))
        pose = PlanarPose(x, y, float(rng.uniform(-math.pi, math.pi))).as_pose()
        if workspace.contains(pose.apply(square_shape().mesh.vertices), _SQUARE_BORDER).all():
            return pose
    raise LayoutError(
        f"no place for a square of {1000 * SQUARE_SIDE:.0f} mm in a workspace "
        f"{workspace.x_max - workspace.x_min:.2f} m wide; use a larger workspace"
    )


def _drop_rope(world: SimWorld, square: Pose, rng: np.random.Generator) -> tuple[SceneObject, ...]:
    """Drop the rope beside the square or inside it and return its beads; its ends are white.

    Raises:
        LayoutError: when there is no free place, or reaches too near to the workspace's edge.
    """
    about = _free_spot(world, square, rng)
    colors = ["white", *["red"] * (ROPE_BEADS - 2), "white"]
    beads = [
        world.add(bead_shape(), about @ pose, color) for pose, color in zip(standing_chain(rng), colors, strict=True)
    ]
    link_beads(world.client, beads)
    let_sleep(world, beads)
    for _ in range(round(_FALL / world.dt)):
        world.step()
    lying = np.array([world.object_xy(bead) for bead in beads])
    if not world.config.workspace.contains(lying, _ROPE_BORDER).all():
        raise LayoutError("the rope fell too near to the workspace's edge")
    return tuple(beads)


def _free_spot(world: SimWorld, square: Pose, rng: np.random.Generator) -> Pose:
    """Draw a place far enough from the workspace's edge and from the square's three sides, whose inside is free.

    Raises:
        LayoutError: when none was drawn.
    """
    workspace = world.config.workspace
    low, high = np.array((workspace.x_min, workspace.y_min)), np.array((workspace.x_max, workspace.y_max))
    for _ in range(_DRAWS):
        at = np.array([*rng.uniform(low + _FOOTPRINT, high - _FOOTPRINT), 0.0])
        x, y = square.inverse().apply(at)[:2] / (SQUARE_SIDE / 2)
        to_sides = [
            math.hypot(max(abs(x) - 1, 0.0), y + 1),
            math.hypot(x - 1, max(abs(y) - 1, 0.0)),
            math.hypot(x + 1, max(abs(y) - 1, 0.0)),
        ]
        if min(to_sides) * SQUARE_SIDE / 2 >= _FOOTPRINT:
            return Pose(np.eye(3), at)
    raise LayoutError("no free place for the rope beside the square's sides; use a larger workspace")
