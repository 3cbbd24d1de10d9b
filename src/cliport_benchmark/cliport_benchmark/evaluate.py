"""Evaluates a policy or the expert over many scenes in full physics, in parallel processes."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import cv2

from cliport_benchmark.agents import EXPERT, Agent, load_agent
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.episode import run_episode
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.journal import Discarded, Journal, Outcome
from cliport_benchmark.observer import Observer
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.wording import Wording
from cliport_policy.checkpoint import resolve_checkpoint
from sim_bridge.errors import LayoutError, PhysicsError, SimBridgeError
from sim_bridge.tasks import PutBlocksInBowls, Task, make_task
from sim_bridge.world import SimConfig, SimWorld


@dataclass(frozen=True)
class EvaluateConfig:
    """What to evaluate.

    Raises:
        OptionError: on numbers that make no evaluation, or a wording for a task that has none.
        UnknownNameError: on an unknown task or split.
    """

    checkpoint: str
    task: str
    split: str
    first_seed: int
    episodes: int
    wording: Wording = field(default_factory=Wording)

    def __post_init__(self) -> None:
        task = make_task(self.task, self.split)
        if self.first_seed < 0:
            raise OptionError(f"--first-seed must be 0 or more, got {self.first_seed}")
        if self.episodes < 1:
            raise OptionError(f"--episodes must be 1 or more, got {self.episodes}")
        if self.is_reworded and not isinstance(task, PutBlocksInBowls):
            raise OptionError(f"--phrasings and --synonyms are for put-blocks-in-bowls, not for {task.name}")

    @property
    def is_reworded(self) -> bool:
        """Whether other sentences than the task's own are said."""
        return self.wording != Wording()

    @property
    def seeds(self) -> range:
        """One a scene."""
        return range(self.first_seed, self.first_seed + self.episodes)

    def settings(self) -> dict[str, Any]:
        """What results must agree in to be of one evaluation; how many episodes it has may grow.

        Raises:
            CheckpointError: when there is no such checkpoint.
            ObjectFolderError: when the task's objects cannot be used.
        """
        settings: dict[str, Any] = {
            "task": self.task,
            "split": self.split,
            "checkpoint": self.checkpoint,
            "first_seed": self.first_seed,
            "object_set": make_task(self.task, self.split).object_source,
        }
        if self.checkpoint != EXPERT:
            weights = resolve_checkpoint(self.checkpoint).read_bytes()
            settings["weights_sha256"] = hashlib.sha256(weights).hexdigest()
        if self.is_reworded:
            settings["wording"] = dataclasses.asdict(self.wording)
        return settings


class Evaluator:
    """One process's world, arm and agent."""

    def __init__(self, config: EvaluateConfig) -> None:
        self.config = config
        self.agent: Agent = load_agent(config.checkpoint)
        self.world = SimWorld(SimConfig())
        self.observer = Observer(self.world.config, n_threads=1)
        self.hand = ArmHand(self.world, self.observer)

    def run(self, seed: int) -> Outcome:
        """What came of the scene of a seed."""
        try:
            task = self.world.reset(self.config.task, self.config.split, seed)
            say = partial(self._sentence, index=seed - self.config.first_seed)
            return run_episode(self.world, self.hand, self.observer, self.agent, task, seed, say)
        except (LayoutError, PhysicsError) as error:
            return Discarded(seed, str(error))

    def _sentence(self, task: Task, index: int) -> str:
        if self.config.is_reworded and isinstance(task, PutBlocksInBowls):
            return self.config.wording.sentence(task.goal, index)
        return task.instruction


def evaluate(
    config: EvaluateConfig, processes: int, journal: Journal, on_outcome: Callable[[Outcome], None]
) -> list[Outcome]:
    """The outcomes in the order of their seeds: those in the journal, and the others, which join it.

    on_outcome hears of each new one.

    Raises:
        BenchmarkError: when the checkpoint cannot be used, or a process died.
    """
    missing = [seed for seed in config.seeds if seed not in journal.outcomes]
    with closing(run_parallel(_run, missing, processes, partial(_set_up, config))) as results:
        for _, outcome in results:
            if isinstance(outcome, str):
                raise BenchmarkError(outcome)
            journal.add(outcome)
            on_outcome(outcome)
    return [journal.outcomes[seed] for seed in config.seeds]


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


def _run(seed: int) -> Outcome | str:
    """An outcome, or why there is none: errors cross processes as text."""
    if not isinstance(_evaluator, Evaluator):
        return _evaluator or "the worker was not set up"
    try:
        return _evaluator.run(seed)
    except (BenchmarkError, SimBridgeError) as error:
        return f"seed {seed}: {error}"
