"""Evaluates a policy or the expert over many scenes in full physics, in parallel processes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import cv2
import numpy as np

from cliport_benchmark.agents import EXPERT, Agent, load_agent
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.episode import Episode, run_episode
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.observer import Observer
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.wording import Wording
from sim_bridge.errors import LayoutError, SimBridgeError
from sim_bridge.tasks import PutBlocksInBowls, make_task
from sim_bridge.world import SimConfig, SimWorld

_DISCARDED = "discarded"


@dataclass(frozen=True)
class EvaluateConfig:
    """What to evaluate.

    Raises:
        OptionError: on numbers that make no evaluation.
        UnknownNameError: on an unknown task or split.
    """

    checkpoint: str
    task: str
    split: str
    first_seed: int
    episodes: int
    wording: Wording = field(default_factory=Wording)

    def __post_init__(self) -> None:
        make_task(self.task, self.split)
        if self.first_seed < 0:
            raise OptionError(f"--first-seed must be 0 or more, got {self.first_seed}")
        if self.episodes < 1:
            raise OptionError(f"--episodes must be 1 or more, got {self.episodes}")


class Evaluator:
    """One process's world, arm and agent."""

    def __init__(self, config: EvaluateConfig) -> None:
        self.config = config
        self.agent: Agent = load_agent(config.checkpoint)
        self.world = SimWorld(SimConfig())
        self.observer = Observer(self.world.config, n_threads=1)
        self.hand = ArmHand(self.world, self.observer)

    def run(self, seed: int) -> Episode | None:
        """The episode of a seed; None when its scene could not be made."""
        try:
            task = self.world.reset(self.config.task, self.config.split, seed)
        except LayoutError:
            return None
        if not isinstance(task, PutBlocksInBowls):
            raise OptionError(f"task {self.config.task} has no evaluation")
        instruction = self.config.wording.sentence(task.goal, seed - self.config.first_seed)
        return run_episode(self.world, self.hand, self.observer, self.agent, task, seed, instruction)


def evaluate(
    config: EvaluateConfig, processes: int, on_episode: Callable[[int, Episode | None], None]
) -> list[Episode]:
    """The episodes in the order of their seeds; on_episode(seed, episode) hears of each as it ends.

    Raises:
        BenchmarkError: when the checkpoint cannot be used, or a process died.
    """
    seeds = range(config.first_seed, config.first_seed + config.episodes)
    episodes: dict[int, Episode] = {}
    with closing(run_parallel(_run, seeds, processes, partial(_set_up, config))) as results:
        for seed, outcome in results:
            if isinstance(outcome, str) and outcome != _DISCARDED:
                raise BenchmarkError(outcome)
            episode = outcome if isinstance(outcome, Episode) else None
            if episode is not None:
                episodes[seed] = episode
            on_episode(seed, episode)
    return [episodes[seed] for seed in seeds if seed in episodes]


def summary(config: EvaluateConfig, episodes: list[Episode]) -> dict[str, Any]:
    """The results as JSON has them; scores 0..100."""
    steps = [step for episode in episodes for step in episode.actions]
    first_right = [any(s.block_right and s.bowl_right for s in e.actions[:1]) for e in episodes]
    outcomes = sorted({step.outcome for step in steps})
    result: dict[str, Any] = {
        "mean_score": _percent([e.score for e in episodes]),
        "chance": _percent([e.chance for e in episodes]),
        "task": config.task,
        "split": config.split,
        "checkpoint": config.checkpoint,
        "first_seed": config.first_seed,
        "n_episodes": len(episodes),
        "discarded": config.episodes - len(episodes),
        "outcomes": {name: sum(step.outcome == name for step in steps) for name in outcomes},
    }
    if config.checkpoint != EXPERT:
        result["choices"] = {
            "block_right": _percent([s.block_right for s in steps]),
            "bowl_right": _percent([s.bowl_right for s in steps]),
            "both_right": _percent([s.block_right and s.bowl_right for s in steps]),
            "first_action_both_right": _percent(first_right),  # a refusal counts as wrong
            "refused": sum(bool(e.error) for e in episodes),
        }
    if config.wording != Wording():
        result["wording"] = dataclasses.asdict(config.wording)
    result["episodes"] = [dataclasses.asdict(e) for e in episodes]
    return result


def _percent(values: list[Any]) -> float | None:
    return round(100.0 * float(np.mean(values)), 2) if values else None


_evaluator: Evaluator | str | None = None  # of this worker process; a string says why there is none


def _set_up(config: EvaluateConfig) -> None:
    global _evaluator
    cv2.setNumThreads(1)
    try:
        if config.checkpoint != EXPERT:
            import torch

            torch.set_num_threads(1)
        _evaluator = Evaluator(config)
    except (BenchmarkError, SimBridgeError) as error:
        _evaluator = str(error)


def _run(seed: int) -> Episode | str:
    """An episode, or why there is none: errors cross processes as text."""
    if not isinstance(_evaluator, Evaluator):
        return _evaluator or "the worker was not set up"
    try:
        return _evaluator.run(seed) or _DISCARDED
    except (BenchmarkError, SimBridgeError) as error:
        return f"seed {seed}: {error}"
