"""What an agent does that sees and handles everything perfectly but does not hear the sentence.

See docs/benchmark.md, "Chance".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cliport_core import PickPlaceAction, Pose, Primitive
from sim_bridge.objects import SceneObject
from sim_bridge.task_mechanics.goal import Goal, PoseMetric, ZoneMetric
from sim_bridge.task_mechanics.object_at import object_at
from sim_bridge.task_mechanics.task import Task
from sim_bridge.world import SimWorld

_SAME_LEVEL = 0.016  # two heights that differ less are one: a kit's print lies 14 mm below its shape's middle [m]
_AT_LEAST = 0.02  # a target with another thing nearer than this is taken [m]
_AT_MOST = 0.04  # from what a thing lies on to its target, in the plane [m]
_SAME_SIZE = 0.001  # things whose edges differ less are equally large [m]


class BlindChooser:
    """Draws one scene's actions.

    world: where the task is set up; rng draws the choices.
    """

    def __init__(self, task: Task, world: SimWorld, rng: np.random.Generator) -> None:
        self._task, self._world, self._rng = task, world, rng
        self._guess: Goal | None = None  # what a drag works for, guessed once a scene

    def action(self) -> PickPlaceAction | None:
        """Return the next action; None when nothing is left that looks right."""
        goals = self._task.goals_without_words()
        if not goals:
            return None
        if self._task.primitive is not Primitive.PICK_PLACE:
            self._guess = self._guess or goals[int(self._rng.integers(len(goals)))]
            return self._task.expert_action_for(self._guess)
        moves: dict[int, list[Goal]] = {}
        for move in self._moves(goals):
            moves.setdefault(move.objects[0].body, []).append(move)
        for body in self._rng.permutation(sorted(moves)):
            for i in self._rng.permutation(len(moves[body])):
                action = self._task.expert_action_for(moves[body][i])
                if action is not None:
                    return action
        return None

    def _moves(self, goals: Sequence[Goal]) -> list[Goal]:
        """Every move that looks right, as a goal of one thing and one target."""
        things = [thing for thing in self._task.objects if not thing.fixed and not self._is_covered(thing)]
        moves = []
        for thing in things:
            offered = [move for goal in goals for move in _offered(goal, goals, thing)]
            open_moves = [move for move in offered if not self._is_there(thing, move)]
            if len(open_moves) == len(offered) or _is_asked_twice(thing, goals):
                moves += [move for move in open_moves if self._is_free(thing, move)]
        return moves

    def _is_covered(self, thing: SceneObject) -> bool:
        """Whether another thing lies on this one."""
        pose = self._world.object_pose(thing)
        above = object_at(self._world, float(pose.translation[0]), float(pose.translation[1]), movable=True)
        return above is not None and above is not thing

    def _is_there(self, thing: SceneObject, move: Goal) -> bool:
        """Whether a thing lies at the move's target already."""
        if isinstance(move.metric, ZoneMetric):
            return move.allows(thing, *map(float, self._world.object_xy(thing)))
        level = self._world.object_pose(thing).translation[2] - move.targets[0].translation[2]
        return bool(move.matched(self._world).any()) and abs(level) < _level_tolerance(move)

    def _is_free(self, thing: SceneObject, move: Goal) -> bool:
        """Whether nothing is at the target, and what a thing there is to lie on is there."""
        if isinstance(move.metric, ZoneMetric) and move.metric.about is None:
            return True  # anywhere in the container
        target = move.targets[0].translation
        near = max(_AT_LEAST, move.metric.position) if isinstance(move.metric, PoseMetric) else _AT_LEAST
        height = float(np.ptp(thing.mesh.vertices[:, 2]))
        beneath: list[float] = []
        for other in self._task.objects:
            if other is thing or other.fixed or other.name != thing.name:
                continue
            at = self._world.object_pose(other).translation
            apart = math.hypot(*(at[:2] - target[:2]))
            if apart < near and abs(at[2] - target[2]) < _level_tolerance(move):
                return False
            if apart < _AT_MOST and 0.5 * height < target[2] - at[2] < 1.5 * height:
                beneath.append(apart)
        return not self._is_raised(target) or len(beneath) > 1 or any(apart < _AT_LEAST for apart in beneath)

    def _is_raised(self, target: npt.NDArray[np.float64]) -> bool:
        """Whether what is at that target lies on another thing of its kind, and not on what is fixed."""
        goals = self._task.goals_without_words()
        low = min(float(pose.translation[2]) for goal in goals for pose in goal.targets)
        return bool(target[2] > low + _SAME_LEVEL)


def _is_asked_twice(thing: SceneObject, goals: Sequence[Goal]) -> bool:
    """Whether a thing goes from target to target, as a ring of the tower does."""
    return sum(thing in goal.objects for goal in goals) > 1


def _level_tolerance(move: Goal) -> float:
    """A bowl's pose is its middle, not where a block in it lies."""
    return max(_SAME_LEVEL, move.metric.position) if isinstance(move.metric, PoseMetric) else _SAME_LEVEL


def _offered(goal: Goal, goals: Sequence[Goal], thing: SceneObject) -> list[Goal]:
    """A goal's targets for a thing: for its own ones as it allows, for one that no goal asks for as for those that look
    like it; a container takes any other too."""
    zone = isinstance(goal.metric, ZoneMetric)
    if any(thing in other.objects for other in goals):
        alike = [i for i, other in enumerate(goal.objects) if other is thing]
        zone = False
    else:
        alike = [i for i, other in enumerate(goal.objects) if _look_alike(thing, other, sizes_too=zone)]
    if alike:
        targets: npt.NDArray[np.intp] = np.flatnonzero(goal.matches[alike].any(axis=0))
    elif zone and not any(_look_alike(thing, other, True) for g in goals for other in g.objects):
        targets = np.arange(len(goal.targets))
    else:
        return []
    symmetries = (goal.symmetries[alike[0]],) if goal.symmetries and alike else ()
    offered: list[Goal] = []
    for j in targets:
        target = goal.targets[j]
        if not any(_same_place(target, move.targets[0]) for move in offered):
            one = np.ones((1, 1), dtype=bool)
            offered.append(replace(goal, objects=(thing,), targets=(target,), matches=one, symmetries=symmetries))
    return offered


def _look_alike(first: SceneObject, second: SceneObject, sizes_too: bool) -> bool:
    """Whether two things have one name and, where that matters, one size."""
    if first.name != second.name:
        return False
    sizes = [np.ptp(thing.mesh.vertices, axis=0) for thing in (first, second)]
    return not sizes_too or bool(np.abs(sizes[0] - sizes[1]).max() < _SAME_SIZE)


def _same_place(first: Pose, second: Pose) -> bool:
    return bool(np.abs(first.translation - second.translation).max() < 1e-6)
