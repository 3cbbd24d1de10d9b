"""Actions of an agent that sees and handles everything perfectly but does not hear the sentence.

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

_LEVEL_TOLERANCE = 0.016  # heights that differ less are equal: a kit's print lies 14 mm below its shape's middle [m]
_TAKEN_DISTANCE = 0.02  # a target with another thing nearer than this is occupied [m]
_SUPPORT_DISTANCE = 0.04  # in the plane, between a target and the thing that it rests on, at most [m]
_SIZE_TOLERANCE = 0.001  # things whose edges differ less are equally large [m]


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
        """Return every move that looks right, as a goal of one thing and one target."""
        things = [thing for thing in self._task.objects if not thing.fixed and not self._is_covered(thing)]
        moves = []
        ground = min(float(pose.translation[2]) for goal in goals for pose in goal.targets)
        for thing in things:
            offered = [move for goal in goals for move in _offered_moves(goal, goals, thing)]
            open_moves = [move for move in offered if not self._is_there(thing, move)]
            if len(open_moves) == len(offered) or _serves_several_goals(thing, goals):
                moves += [move for move in open_moves if self._is_free(thing, move, ground)]
        return moves

    def _is_covered(self, thing: SceneObject) -> bool:
        """Return True if another thing lies on this one."""
        pose = self._world.object_pose(thing)
        above = object_at(self._world, float(pose.translation[0]), float(pose.translation[1]), movable=True)
        return above is not None and above is not thing

    def _is_there(self, thing: SceneObject, move: Goal) -> bool:
        """Return True if a thing lies at the move's target already."""
        if isinstance(move.metric, ZoneMetric):
            return move.allows(thing, *map(float, self._world.object_xy(thing)))
        level = self._world.object_pose(thing).translation[2] - move.targets[0].translation[2]
        return bool(move.matched(self._world).any()) and abs(level) < _level_tolerance(move)

    def _is_free(self, thing: SceneObject, move: Goal, ground: float) -> bool:
        """Return True if the target is free and, where it is above the ground, the thing that it rests on is there.

        ground: height of the lowest target of all goals [m]; what is higher rests on another thing of its kind instead
        of on what is fixed.
        """
        if isinstance(move.metric, ZoneMetric) and move.metric.about is None:
            return True  # anywhere in the container
        target = move.targets[0].translation
        near = max(_TAKEN_DISTANCE, move.metric.position) if isinstance(move.metric, PoseMetric) else _TAKEN_DISTANCE
        height = float(np.ptp(thing.mesh.vertices[:, 2]))
        beneath: list[float] = []
        for other in self._task.objects:
            if other is thing or other.fixed or other.name != thing.name:
                continue
            at = self._world.object_pose(other).translation
            apart = math.hypot(*(at[:2] - target[:2]))
            if apart < near and abs(at[2] - target[2]) < _level_tolerance(move):
                return False
            if apart < _SUPPORT_DISTANCE and 0.5 * height < target[2] - at[2] < 1.5 * height:
                beneath.append(apart)
        is_raised = bool(target[2] > ground + _LEVEL_TOLERANCE)
        return not is_raised or len(beneath) > 1 or any(apart < _TAKEN_DISTANCE for apart in beneath)


def _serves_several_goals(thing: SceneObject, goals: Sequence[Goal]) -> bool:
    """Return True if a thing goes from target to target, as a ring of the tower does."""
    return sum(thing in goal.objects for goal in goals) > 1


def _level_tolerance(move: Goal) -> float:
    """Return the largest height difference at which a thing counts as at its target: a
    bowl's pose is its middle, not where a block in it lies."""
    return max(_LEVEL_TOLERANCE, move.metric.position) if isinstance(move.metric, PoseMetric) else _LEVEL_TOLERANCE


def _offered_moves(goal: Goal, goals: Sequence[Goal], thing: SceneObject) -> list[Goal]:
    """Return a goal's targets for a thing as moves: its own targets as matches allow; for a thing that no goal asks
    for, the targets of those that look like it; a container takes any other thing too."""
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
    """Return True if two things have one name and, with sizes_too, one size."""
    if first.name != second.name:
        return False
    sizes = [np.ptp(thing.mesh.vertices, axis=0) for thing in (first, second)]
    return not sizes_too or bool(np.abs(sizes[0] - sizes[1]).max() < _SIZE_TOLERANCE)


def _same_place(first: Pose, second: Pose) -> bool:
    return bool(np.abs(first.translation - second.translation).max() < 1e-6)
