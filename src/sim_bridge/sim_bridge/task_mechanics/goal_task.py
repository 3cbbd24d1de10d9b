"""Common part of the benchmark's tasks: goals one after another, their score, and the expert."""

from __future__ import annotations

import itertools
import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core import PickPlaceAction, PlanarPose, Primitive
from sim_bridge.errors import SimulationError
from sim_bridge.objects import Pinch, SceneObject
from sim_bridge.task_mechanics.clearance import FingerClearance
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.task_mechanics.object_at import object_at
from sim_bridge.task_mechanics.pinches import gripper_at, pinches_of
from sim_bridge.task_mechanics.placing import outline
from sim_bridge.task_mechanics.task import JudgedAction, Split, Task
from sim_bridge.world import SimWorld

_TIP_CLEARANCE = 0.004  # of the fingertips above the ground of a thing at least [m]
_MOVED_DISTANCE = 0.003  # a thing that moved less was not carried [m]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Way:
    """One way to hold and turn a thing: the fingers' ground that is taken, the turn and its size, width, and action."""

    taken: float
    size: float
    width: float
    turn: float
    action: PickPlaceAction

    @property
    def cost(self) -> tuple[float, float, float]:
        """Less is better, the first first."""
        return self.taken, self.size, self.width

    def is_quarter_of(self, other: _Way) -> bool:
        """Return True if this is the other with the gripper turned by a quarter."""
        here, there = self.action.pick, other.action.pick
        same_place = math.hypot(here.x - there.x, here.y - there.y) < 1e-6
        return same_place and abs(abs(math.remainder(here.yaw - there.yaw, math.pi)) - math.pi / 2) < 1e-6


class GoalTask(Task):
    """A task is its scene and its goals: a subclass spawns and draws them in `set_up`.

    Score, order of the goals and expert: docs/benchmark.md, "Scores" and "The expert".
    """

    done_sentence: str = "done."

    def __init__(self, name: str, split: Split) -> None:
        self.name = name
        self.split = split
        self._world: SimWorld | None = None
        self._goals: tuple[Goal, ...] = ()
        self._reached = 0
        self._left_score: float | None = None  # score left by the last action; None before the first
        self._proposed: tuple[SceneObject, FloatArray] | None = None  # what is to be moved; all positions then
        self._in_vain: list[SceneObject] = []  # things that were to be moved since anything moved

    @abstractmethod
    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        """Create everything in the empty world and return the goals in their order.

        Raises:
            LayoutError: when a thing found no free place.
        """

    def reset(self, world: SimWorld, rng: np.random.Generator) -> None:
        """Set the scene up and forget the last one."""
        self._world = world
        self._goals, self._reached, self._left_score = tuple(self.set_up(world, rng)), 0, None
        self._proposed, self._in_vain = None, []

    @property
    def world(self) -> SimWorld:
        """World in which the task is set up.

        Raises:
            SimulationError: before the first reset.
        """
        if self._world is None:
            raise SimulationError("the task has no scene yet: call reset_scene first")
        return self._world

    @property
    def present_goal(self) -> Goal | None:
        """The goal to be reached now; None when all are reached."""
        return self._goals[self._reached] if self._reached < len(self._goals) else None

    @property
    def goals(self) -> Sequence[Goal]:
        """All goals in their order."""
        return self._goals

    @property
    def arrivals(self) -> Sequence[tuple[PlanarPose, float]]:
        """Places where the task will put things down later, each with the radius of what comes [m]."""
        return ()

    @property
    def goals_reached(self) -> int:
        """Number of the goals that were reached."""
        return self._reached

    def goals_without_words(self) -> Sequence[Goal]:
        """Return the goals that will be asked for one after the other; for tasks in which nothing else could be."""
        return self._goals

    @property
    def instruction(self) -> str:
        """The present goal's sentence; `done_sentence` when nothing is left to do."""
        goal = self.present_goal
        return self.done_sentence if goal is None or self.done() else goal.sentence

    @property
    def sentences_done(self) -> Sequence[str]:
        """See Task."""
        found: list[str] = []
        for goal in reversed(self._goals[: self._reached]):
            if goal.sentence not in (self.instruction, *found) and goal.reached(self.world):
                found.append(goal.sentence)
        return found

    @property
    def objects(self) -> Sequence[SceneObject]:
        """Everything that lies on the table."""
        return self.world.objects

    def score(self) -> float:
        """Return the score that the last action left; before the first one, the running score."""
        return self.running_score() if self._left_score is None else self._left_score

    def score_with_next(self) -> float:
        """Return the running score: after `advance` the present goal is the next one."""
        return self.running_score()

    def running_score(self) -> float:
        """Return the score that an action would leave if it ended now: goals that
        were reached, and the present one's share."""
        goal = self.present_goal
        progress = sum(g.max_reward for g in self._goals[: self._reached])
        return float(progress + (goal.max_reward * goal.value(self.world) if goal else 0.0))

    def advance(self) -> None:
        """Judge the scene after an action: a goal that was reached once is never looked at again, and a thing that did
        not move now waits until something else has.

        The score is taken before the next goal becomes present: as far as that is fulfilled already, only the next
        action makes it count (docs/benchmark.md, "Scores").
        """
        self.keep_score()
        goal = self.present_goal
        if goal is not None and goal.reached(self.world):
            self._reached += 1
        self.note_what_moved()

    def note_what_moved(self) -> None:
        """Note after an action whether the thing that was to be moved was so in vain, because nothing moved."""
        if self._proposed is not None:
            thing, before = self._proposed
            now = self._positions()
            still = now.shape == before.shape and bool(np.abs(now - before).max() < _MOVED_DISTANCE)
            self._in_vain = [*self._in_vain, thing] if still else []
            self._proposed = None

    def keep_score(self) -> None:
        """Take the running score as the one that the last action left."""
        self._left_score = self.running_score()

    def expert_action(self) -> PickPlaceAction | None:
        """Return the expert's action for the present goal: the object farthest from where it belongs comes first."""
        goal = self.present_goal
        return None if goal is None or self.done() else self.expert_action_for(goal)

    def expert_action_for(self, goal: Goal) -> PickPlaceAction | None:
        """Return the expert's action for a goal; what was tried in vain comes last."""
        for thing, target in sorted(self.moves_to_make(goal), key=lambda move: self.tries_in_vain(move[0])):
            action = self.move(goal, thing, target)
            if action is not None:
                self.propose(thing)
                return action
        return None

    def propose(self, thing: SceneObject) -> None:
        """Note that an action is about to be done with a thing: `advance` sees whether it was in vain."""
        self._proposed = (thing, self._positions())

    def tries_in_vain(self, thing: SceneObject) -> int:
        """Count how often this thing was to be moved since anything moved."""
        return self._in_vain.count(thing)

    def _positions(self) -> FloatArray:
        return np.array([self.world.object_pose(thing).translation for thing in self.objects])

    def moves_to_make(self, goal: Goal) -> list[tuple[SceneObject, PlanarPose]]:
        """Return the objects that are to be moved with their nearest free targets, the farthest first."""
        world = self.world
        matches = goal.matches.copy()
        if not goal.replace:
            matched = goal.matched(world)
            for i, j in zip(*np.nonzero(matched), strict=True):
                if matches[i, j]:
                    matches[i, :], matches[:, j] = False, False
        moves = []
        for i, thing in enumerate(goal.objects):
            allowed = np.flatnonzero(matches[i])
            if len(allowed) == 0:
                continue
            at = world.object_pose(thing).translation
            distances = [float(np.linalg.norm(goal.targets[j].translation - at)) for j in allowed]
            nearest = int(np.argmin(distances))
            moves.append((distances[nearest], i, PlanarPose.from_pose(goal.targets[allowed[nearest]])))
        moves.sort(key=lambda move: (-move[0], move[1]))
        return [(goal.objects[i], target) for distance, i, target in moves if distance > 0.0]

    def move(self, goal: Goal, thing: SceneObject, target: PlanarPose) -> PickPlaceAction | None:
        """Return the pick and place that puts a thing's frame at the target: of all ways to hold and turn it, the one
        with the largest clearance for the fingers, then the least turn. None when it cannot be held."""
        world = self.world
        pinches = self.pinches(thing)
        if not pinches:
            return None
        here = world.planar_pose(thing)
        bottom = float(world.object_pose(thing).apply(thing.mesh.vertices)[:, 2].min())
        at_pick = FingerClearance(world, thing, bottom + _TIP_CLEARANCE)
        at_place = FingerClearance(world, thing, self.place_level(goal, thing) + _TIP_CLEARANCE)
        ways: list[_Way] = []
        for pinch, turn in itertools.product(pinches, self._turns(goal, thing, here, target)):
            pick = gripper_at(here, pinch)
            place = gripper_at(PlanarPose(target.x, target.y, here.yaw + turn), pinch)
            taken = at_pick.blocked(pick, pinch.width) + at_place.blocked(place, pinch.width)
            action = PickPlaceAction(pick, place, self.primitive)
            ways.append(_Way(round(taken, 3), round(abs(turn), 6), round(pinch.width, 6), turn, action))
        best = min(ways, key=lambda way: way.cost)
        quarter_too = any(way.cost == best.cost and way.is_quarter_of(best) for way in ways)
        period = math.pi / 2 if quarter_too else math.pi
        pick, place = best.action.pick, best.action.place
        yaw = math.remainder(pick.yaw, period)
        return PickPlaceAction(
            PlanarPose(pick.x, pick.y, yaw),
            PlanarPose(place.x, place.y, yaw + best.turn),
            self.primitive,
            pick_yaw_period=period,
        )

    def pinches(self, thing: SceneObject) -> list[Pinch]:
        """Return the ways to hold a thing, relative to its planar pose; a task may know better."""
        return pinches_of(self.world, thing)

    def place_level(self, goal: Goal, thing: SceneObject) -> float:
        """Return the height on which a thing will lie at its target [m]; a task may know better."""
        return 0.0

    def judge(self, pick: PlanarPose, place: PlanarPose, exact_offset: bool = False) -> JudgedAction:
        """Judge an action by the objects under its two poses."""
        picked = object_at(self.world, pick.x, pick.y, movable=True)
        under = object_at(self.world, place.x, place.y, movable=False)
        goal = self.present_goal
        if goal is None or picked is None or picked not in goal.objects:
            return JudgedAction(picked.described if picked else "", under.described if under else "", False, False)
        here = self.world.planar_pose(picked)
        centres = self.primitive is Primitive.PICK_PLACE and not exact_offset  # a fold acts where it is told
        held = self._centred(picked, pick) if centres else pick
        there = place @ held.inverse() @ here
        fits = goal.allows(picked, there.x, there.y)
        open_moves = [thing for thing, _ in self.moves_to_make(goal)]
        return JudgedAction(picked.described, under.described if under else "", picked in open_moves, fits)

    def _centred(self, thing: SceneObject, pick: PlanarPose) -> PlanarPose:
        """Return the pick moved to where the hand would hold the thing: its middle, or the nearest of its pinches."""
        here = self.world.planar_pose(thing)
        middle = outline(self.world, thing)
        places = [((middle.min(axis=0) + middle.max(axis=0)) / 2).tolist()]
        places += [(held.x, held.y) for held in (gripper_at(here, pinch) for pinch in self.pinches(thing))]
        x, y = min(places, key=lambda at: math.hypot(at[0] - pick.x, at[1] - pick.y))
        return PlanarPose(float(x), float(y), pick.yaw)

    def _turns(self, goal: Goal, thing: SceneObject, here: PlanarPose, target: PlanarPose) -> list[float]:
        """Return every turn [rad] that brings a thing to its target's yaw, up to its symmetry."""
        if not goal.turn:
            return [0.0]
        symmetry = thing.shape.symmetry
        if symmetry == 0.0 or (goal.symmetries and goal.symmetries[goal.objects.index(thing)] == 0.0):
            return [math.radians(angle) for angle in (0, 30, -30, 60, -60, 90)]
        exact = math.remainder(target.yaw - here.yaw, math.tau)
        count = round(math.tau / symmetry)
        return [math.remainder(exact + k * symmetry, math.tau) for k in range(count)]
