"""One evaluation episode in full physics, step by step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from cliport_benchmark.agents import Agent
from cliport_benchmark.observer import Observer
from cliport_core import ActionResult, PickPlaceAction, PlanarPose, Primitive
from cliport_policy.errors import PolicyError
from sim_bridge.errors import PhysicsError
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.scene import Stream, scene_rng
from sim_bridge.tasks import JudgedAction, Task
from sim_bridge.world import SimWorld


class EpisodeHand(Protocol):
    """Carries out an episode's actions, with the arm or without."""

    def new_scene(self, primitive: Primitive) -> None:
        """Take note that the world was reset to a scene in which the hand does that."""

    def execute(self, action: PickPlaceAction, frame: RgbdFrame) -> ActionResult:
        """Execute an action and let the world settle."""


@dataclass(frozen=True)
class Step:
    """One action: what was said, the poses (x, y [m], yaw [rad]), what they mean in the scene ("": nothing there)
    and whether that is what the goal asks for, and what came of it; score 0..1 afterwards.

    score_with_next: 0..1, with the next goal counted as far as it is fulfilled already; None in results of old."""

    instruction: str
    primitive: str
    pick: tuple[float, float, float]
    place: tuple[float, float, float]
    picked: str
    place_at: str
    pick_right: bool
    place_right: bool
    outcome: str
    message: str
    done_probability: float | None
    score: float
    score_with_next: float | None = None


@dataclass(frozen=True)
class Episode:
    """One scene's outcome; score 0..1. instruction: the first. chance: what random choices would score on
    average, where that is known. error: why the agent stopped before its steps were spent. redraws: scenes that were
    drawn in vain before this one. broken: objects flew apart in the last action: the score is what stood before it.
    own_wording: where sentences are reworded, one had another form than the task's pattern and was said as it is."""

    seed: int
    score: float
    steps: int
    max_steps: int
    goals_reached: int
    instruction: str
    chance: float | None
    simulated_s: float
    error: str
    actions: tuple[Step, ...]
    redraws: int = 0
    broken: bool = False
    own_wording: bool = False

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Episode:
        """Return the episode that dataclasses.asdict made a dict of, also after JSON made lists of the tuples."""
        actions = [Step(**{**a, "pick": tuple(a["pick"]), "place": tuple(a["place"])}) for a in values["actions"]]
        return cls(**{**values, "actions": tuple(actions)})


def run_episode(
    world: SimWorld,
    hand: EpisodeHand,
    observer: Observer,
    agent: Agent,
    task: Task,
    seed: int,
    sentence: Callable[[Task], str],
    exact_offset: bool = False,
) -> Episode:
    """Let the agent act until the task is reached or its steps are spent; sentence: what to say before each step.

    The world is freshly reset to the task. exact_offset: what `hand` was made with.

    Raises:
        PhysicsError: when objects flew apart before the first action: the scene is worth nothing.
    """
    observer.new_scene(scene_rng(task.name, task.split, seed, Stream.SCORED_NOISE))
    chance = task.chance_score(scene_rng(task.name, task.split, seed, Stream.CHANCE))
    hand.new_scene(task.primitive)
    agent.new_scene(task, world, scene_rng(task.name, task.split, seed, Stream.AGENT))
    first, start = sentence(task), world.time
    steps: list[Step] = []
    error, broken = _act(world, hand, observer, agent, task, sentence, exact_offset, steps)
    return Episode(
        seed,
        steps[-1].score if steps else 0.0,
        len(steps),
        task.max_steps,
        task.goals_reached,
        first,
        chance,
        round(round((world.time - start) / world.dt) * world.dt, 3),  # whole steps: the start must not matter
        error,
        tuple(steps),
        task.redraws,
        broken,
    )


def _act(
    world: SimWorld,
    hand: EpisodeHand,
    observer: Observer,
    agent: Agent,
    task: Task,
    sentence: Callable[[Task], str],
    exact_offset: bool,
    steps: list[Step],
) -> tuple[str, bool]:
    """Add the agent's steps to `steps`; return why it stopped before they were spent, and whether objects flew
    apart."""
    for _ in range(task.max_steps):
        if task.done():
            break
        frame = observer.frame(world)
        said = sentence(task)
        try:
            action, done_probability = agent.decide(task, observer.heightmap(frame), said)
        except PolicyError as refusal:
            return str(refusal), False
        if action is None:
            return "the agent sees nothing that can be done", False
        meant = task.judge(action.pick, action.place, exact_offset)
        try:
            result = hand.execute(action, frame)
        except PhysicsError as burst:
            return str(burst), True
        task.advance()
        steps.append(_step(said, action, done_probability, meant, result, (task.score(), task.score_with_next())))
    return "", False


def _step(
    said: str,
    action: PickPlaceAction,
    done_probability: float | None,
    meant: JudgedAction,
    result: ActionResult,
    scores: tuple[float, float],
) -> Step:
    """Return what is kept of an action. scores: after it, without and with the next goal."""
    return Step(
        said,
        action.primitive.label,
        _rounded(action.pick),
        _rounded(action.place),
        meant.picked,
        meant.place,
        meant.pick_right,
        meant.place_right,
        result.outcome.name,
        result.message,
        None if done_probability is None else round(done_probability, 4),
        *scores,
    )


def _rounded(pose: PlanarPose) -> tuple[float, float, float]:
    return round(pose.x, 4), round(pose.y, 4), round(math.remainder(pose.yaw, math.tau), 4)
