"""assembling-kits-seq: each shape into its own print, in the sentences' order.

See docs/benchmark.md, "assembling-kits-seq".
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from cliport_core import PickPlaceAction, PlanarPose
from sim_bridge.objects.kit_shapes import KIT_SHAPES
from sim_bridge.task_mechanics.goal import FloatArray, Goal, PoseMetric
from sim_bridge.task_mechanics.task import Split
from sim_bridge.tasks.kit_task import N_HOLES, Fit, KitTask, kit_shapes_of
from sim_bridge.tasks.variants import Variant
from sim_bridge.world import SimWorld

_WRONG_TURN = PoseMetric().rotation + math.radians(5)  # of a mistake, at least: well beyond what the metric allows


class AssemblingKitsSeq(KitTask):
    """Five shapes of five colours, one goal each."""

    sentence_pattern = "put the {color} {shape} in the {hole} hole"
    stepwise = True
    knows_mistakes = True

    def __init__(self, name: str, split: Split, variant: Variant) -> None:
        super().__init__(name, split)
        self.palette = variant.palette(split)
        self.shapes = tuple(range(len(KIT_SHAPES))) if variant is Variant.FULL else kit_shapes_of(split)

    @property
    def max_steps(self) -> int:
        """The number of prints: no mistake is allowed."""
        return N_HOLES

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create the kit and its shapes, and return a goal for each."""
        colors = [str(color) for color in rng.permutation(self.palette)[:N_HOLES]]
        fits = self.spawn(world, rng, colors, self.shapes)
        return [_goal(fits[i], fits) for i in rng.permutation(N_HOLES)]

    def mistake(self, rng: np.random.Generator) -> PickPlaceAction | None:
        """Return an action that puts the present goal's shape turned wrongly into its print, or into one that waits."""
        goal, waiting = self.present_goal, self.goals[self.goals_reached + 1 :]
        if goal is None or self.done():
            return None
        period = goal.symmetries[0]
        if period > 2 * _WRONG_TURN and (not waiting or rng.random() < 0.5):
            target = PlanarPose.from_pose(goal.targets[0])
            turn = float(rng.uniform(_WRONG_TURN, period - _WRONG_TURN))
            target = PlanarPose(target.x, target.y, target.yaw + turn)
        elif waiting:
            target = PlanarPose.from_pose(waiting[int(rng.integers(len(waiting)))].targets[0])
        else:
            return None
        return self.move(goal, goal.objects[0], target)


def _goal(fit: Fit, fits: Sequence[Fit]) -> Goal:
    name = fit.thing.name
    same = [other.hole_pose.translation[:2] for other in fits if other.index == fit.index and other is not fit]
    return Goal(
        f"put the {fit.thing.color} {name} in the {which_of(fit.hole_pose.translation[:2], same)}{name} hole",
        (fit.thing,),
        (fit.hole_pose,),
        np.ones((1, 1), dtype=bool),
        PoseMetric(),
        max_reward=1.0 / N_HOLES,
        symmetries=(fit.period,),
        target_name=f"{name} hole",
    )


def which_of(at: FloatArray, others: Sequence[FloatArray]) -> str:
    """Return the word, with a space behind, that tells one of some equal prints apart; "" when there is only one.

    at and each of others: x, y [m]; top is towards the robot, left towards -y.
    """
    if not others:
        return ""
    away = np.array(others) - at
    dx, dy = away[:, 0], away[:, 1]
    along_x = np.abs(dx) > np.abs(dy)
    rules = {"top ": (dx > 0) & along_x, "bottom ": (dx < 0) & along_x, "left ": dy > 0, "right ": dy < 0}
    return next((word for word, holds in rules.items() if holds.all()), "middle ")
