"""One evaluation episode in full physics, step by step."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cliport_benchmark.agents import Agent, Decision
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.chance import chance_score
from cliport_benchmark.observer import Observer
from cliport_perception import PlanarPose
from cliport_policy.errors import PolicyError
from panda_executor.request import PickPlaceResult
from sim_bridge.tasks import Choice, PutBlocksInBowls, Task
from sim_bridge.world import SimWorld, scene_rng

_NOISE_STREAM, _CHANCE_STREAM = 4, 5  # of scene_rng


@dataclass(frozen=True)
class Step:
    """One action: what was said, the poses (x, y [m], yaw [rad]), what they mean in the scene ("": nothing there)
    and whether that is what the goal asks for, and what came of it; score 0..1 afterwards."""

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


@dataclass(frozen=True)
class Episode:
    """One scene's outcome; score 0..1. instruction: the first. chance: what random choices would score on
    average, where that is known. error: why the agent stopped before its steps were spent."""

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

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Episode:
        """The inverse of dataclasses.asdict, also after JSON made lists of the tuples."""
        actions = [Step(**{**a, "pick": tuple(a["pick"]), "place": tuple(a["place"])}) for a in values["actions"]]
        return cls(**{**values, "actions": tuple(actions)})


def run_episode(
    world: SimWorld,
    hand: ArmHand,
    observer: Observer,
    agent: Agent,
    task: Task,
    seed: int,
    sentence: Callable[[Task], str],
) -> Episode:
    """Let the agent act until the task is reached or its steps are spent; sentence: what to say before each step.

    The world is freshly reset to the task.

    Raises:
        PhysicsError: when objects flew apart: the episode is worth nothing.
    """
    observer.new_scene(scene_rng(task.name, task.split, seed, _NOISE_STREAM))
    chance = None
    if isinstance(task, PutBlocksInBowls):
        chance = chance_score(task, scene_rng(task.name, task.split, seed, _CHANCE_STREAM))
    hand.new_scene()
    first, start, error = sentence(task), world.time, ""
    steps: list[Step] = []
    for _ in range(task.max_steps):
        if task.done():
            break
        frame = observer.frame(world)
        said = sentence(task)
        try:
            decision = agent.decide(task, observer.heightmap(frame), said)
        except PolicyError as refusal:
            error = str(refusal)
            break
        if decision is None:
            error = "the agent sees nothing that can be done"
            break
        meant = task.judge(decision.pick, decision.place)
        result = hand.execute(decision.pick, decision.place, frame, decision.primitive)
        task.advance()
        steps.append(_step(said, decision, meant, result, task.score()))
    return Episode(
        seed,
        task.score(),
        len(steps),
        task.max_steps,
        task.goals_reached,
        first,
        chance,
        round(round((world.time - start) / world.dt) * world.dt, 3),  # whole steps: the start must not matter
        error,
        tuple(steps),
    )


def _step(said: str, decision: Decision, meant: Choice, result: PickPlaceResult, score: float) -> Step:
    done = decision.done_probability
    return Step(
        said,
        decision.primitive.name.lower(),
        _rounded(decision.pick),
        _rounded(decision.place),
        meant.picked,
        meant.place,
        meant.pick_right,
        meant.place_right,
        result.outcome.name,
        result.message,
        None if done is None else round(done, 4),
        score,
    )


def _rounded(pose: PlanarPose) -> tuple[float, float, float]:
    return round(pose.x, 4), round(pose.y, 4), round(math.remainder(pose.yaw, math.tau), 4)
