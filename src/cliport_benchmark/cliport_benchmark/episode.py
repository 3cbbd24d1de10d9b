"""One evaluation episode in full physics, step by step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cliport_benchmark.agents import Agent, Decision
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.chance import chance_score
from cliport_benchmark.observer import Observer
from cliport_policy.errors import PolicyError
from panda_executor.request import PickPlaceResult
from sim_bridge.objects import Kind
from sim_bridge.tasks import PutBlocksInBowls
from sim_bridge.world import SimWorld, scene_rng

_NOISE_STREAM, _CHANCE_STREAM = 4, 5  # of scene_rng
_NEAR = 0.04  # a pose farther from every object's middle means none of them [m]


@dataclass(frozen=True)
class Step:
    """One action: the colours that its poses mean (None: nothing there), and what came of it."""

    pick: tuple[float, float, float]  # x, y [m], yaw [rad]
    place: tuple[float, float, float]
    block: str | None
    bowl: str | None
    block_right: bool
    bowl_right: bool
    outcome: str
    message: str
    done_probability: float | None
    score: float


@dataclass(frozen=True)
class Episode:
    """One scene's outcome; score 0..1, chance: what random choices would score on average."""

    seed: int
    score: float
    steps: int
    max_steps: int
    instruction: str
    block: str
    bowl: str
    chance: float
    simulated_s: float
    error: str
    actions: tuple[Step, ...]


def run_episode(
    world: SimWorld,
    hand: ArmHand,
    observer: Observer,
    agent: Agent,
    task: PutBlocksInBowls,
    seed: int,
    instruction: str,
) -> Episode:
    """Let the agent act on the instruction until the goal is reached or its steps are spent.

    The world is freshly reset to the task.
    """
    goal = task.goal
    observer.new_scene(scene_rng(task.name, task.split, seed, _NOISE_STREAM))
    chance = chance_score(task, scene_rng(task.name, task.split, seed, _CHANCE_STREAM))
    hand.new_scene()
    start, steps, error = world.time, [], ""
    for _ in range(task.max_steps):
        if task.done():
            break
        frame = observer.frame(world)
        try:
            decision = agent.decide(task, observer.heightmap(frame), instruction)
        except PolicyError as refusal:
            error = str(refusal)
            break
        if decision is None:
            break
        meant = _meant(task, decision)
        result = hand.pick_and_place(decision.pick, decision.place, frame)
        steps.append(_step(task, decision, meant, result))
    return Episode(
        seed,
        task.score(),
        len(steps),
        task.max_steps,
        instruction,
        goal.block,
        goal.bowl,
        chance,
        round(world.time - start, 3),
        error,
        tuple(steps),
    )


def _meant(task: PutBlocksInBowls, decision: Decision) -> tuple[str | None, str | None]:
    """Colours of the block under the pick and of the bowl under the place."""
    return (
        _nearest_color(task, Kind.BLOCK, decision.pick.x, decision.pick.y, _NEAR),
        _nearest_color(task, Kind.BOWL, decision.place.x, decision.place.y, _NEAR + 0.01),
    )


def _nearest_color(task: PutBlocksInBowls, kind: Kind, x: float, y: float, reach: float) -> str | None:
    if not any(o.kind is kind for o in task.objects):
        return None
    thing, distance = task.nearest(kind, x, y)
    return thing.color if distance <= reach else None


def _step(
    task: PutBlocksInBowls,
    decision: Decision,
    meant: tuple[str | None, str | None],
    result: PickPlaceResult,
) -> Step:
    block, bowl = meant
    pick, place = decision.pick, decision.place
    done = decision.done_probability
    return Step(
        tuple(np.round((pick.x, pick.y, math.remainder(pick.yaw, math.tau)), 4).tolist()),
        tuple(np.round((place.x, place.y, math.remainder(place.yaw, math.tau)), 4).tolist()),
        block,
        bowl,
        block == task.goal.block,
        bowl == task.goal.bowl,
        result.outcome.name,
        result.message,
        None if done is None else round(done, 4),
        task.score(),
    )
