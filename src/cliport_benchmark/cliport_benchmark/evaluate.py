"""Evaluates a policy or the expert over many scenes in full physics, in parallel processes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import cv2

from cliport_benchmark.agents import BUILT_IN, POLICY_MODULE, Agent, PolicyAgent, load_agent
from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.episode import EpisodeHand, run_episode
from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.journal import Discarded, Journal, Outcome
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.policy_facts import policy_facts
from cliport_benchmark.ray_cluster import RayCluster
from cliport_benchmark.survey_colors import LEAST_DISTANCE, paint
from cliport_benchmark.variation import Variation
from cliport_benchmark.wording import Wording
from sim_bridge.errors import LayoutError, PhysicsError, SimBridgeError
from sim_bridge.scene import Stream, reset_scene, scene_rng
from sim_bridge.tasks import Task, make_task
from sim_bridge.world import SimWorld


@dataclass(frozen=True)
class EvaluateConfig:
    """Settings of an evaluation. exact_offset: a thing that is picked off its middle is placed as far off.
    survey_colors: the benchmark's colours look and are called as in draw_colors. without_arm: things are set where
    they belong, for agents that know where to hold them. left_out: parts of the policy's network that it acts without.

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
    exact_offset: bool = False
    setup: OwnSetup = field(default_factory=OwnSetup)
    variation: Variation = field(default_factory=Variation)
    survey_colors: bool = False
    without_arm: bool = False
    left_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        task = make_task(self.task, self.split)
        if self.first_seed < 0:
            raise OptionError(f"--first-seed must be 0 or more, got {self.first_seed}")
        if self.episodes < 1:
            raise OptionError(f"--episodes must be 1 or more, got {self.episodes}")
        if self.without_arm and self.checkpoint not in BUILT_IN:
            raise OptionError(
                f"--without-arm is for {' and '.join(BUILT_IN)}, who know where to hold things; got {self.checkpoint}"
            )
        if self.left_out and self.checkpoint in BUILT_IN:
            raise OptionError(f"--leave-out leaves out parts of a policy's network, and {self.checkpoint} has none")
        if self.without_arm and self.exact_offset:
            raise OptionError("--exact-offset is of the arm: with --without-arm a thing is always placed as it is held")
        if self.is_reworded and not task.sentence_pattern:
            raise OptionError(
                f"--phrasings, --synonyms and --survey-colors cannot reword {task.name}: its sentences have no slots"
            )
        if self.survey_colors and task.object_source:
            raise OptionError(
                f"--survey-colors cannot paint the things of {task.name}, whose names say their own colours"
            )
        if self.survey_colors and self.wording.synonyms:
            raise OptionError("--synonyms and --survey-colors name the same colours: give one of them")

    @property
    def is_reworded(self) -> bool:
        """True if other sentences than the task's own are said."""
        return self.survey_colors or self.wording != Wording()

    @property
    def seeds(self) -> range:
        """One a scene."""
        return range(self.first_seed, self.first_seed + self.episodes)

    def settings(self) -> dict[str, Any]:
        """Return the settings in which results must agree to be of one evaluation; the number of its episodes may grow.

        Raises:
            CheckpointError: when there is no such checkpoint.
            OptionError: when its network cannot be scored.
            ConfigError: when its network has no part that is to be left out.
            ObjectFolderError: when the task's objects cannot be used.
        """
        settings: dict[str, Any] = {
            "task": self.task,
            "split": self.split,
            "checkpoint": self.checkpoint,
            "first_seed": self.first_seed,
            "object_set": make_task(self.task, self.split).object_source,
            "offset": "exact" if self.exact_offset else "centred",
            **self.setup.settings(),
            "randomize": self.variation.settings() or False,
        }
        if self.checkpoint not in BUILT_IN:
            settings |= policy_facts(self.checkpoint, self.left_out)
        if self.wording != Wording():
            settings["wording"] = dataclasses.asdict(self.wording)
        if self.survey_colors:
            settings["survey_colors"] = LEAST_DISTANCE
        if self.without_arm:
            settings["without_arm"] = True
        return settings


class Evaluator:
    """One process's world, arm and agent."""

    def __init__(self, config: EvaluateConfig) -> None:
        self.config = config
        self.agent: Agent = load_agent(config.checkpoint, config.left_out)
        _check_workspace(self.agent, config)
        self.world = SimWorld(config.setup.sim_config())
        setup, variation = config.setup, config.variation
        self.observer = Observer(
            self.world.config, n_threads=1, variation=variation, camera=setup.camera, camera_kind=setup.camera_kind
        )
        self._said_as_it_was = False  # a sentence of this episode that was to be reworded and could not be
        self.hand: EpisodeHand | None = None  # without the arm each scene has a hand of its own
        if not config.without_arm:
            self.hand = ArmHand(self.world, self.observer, exact_offset=config.exact_offset)

    def run(self, seed: int) -> Outcome:
        """Run the scene of a seed and return its outcome."""
        try:
            wording = self._paint(seed)
            task = reset_scene(self.world, self.config.task, self.config.split, seed)
            self.config.variation.add_to(self.world, task, seed)
            say = partial(self._sentence, wording=wording, index=seed - self.config.first_seed)
            exact = self.config.exact_offset
            self._said_as_it_was = False
            own = scene_rng(task.name, task.split, seed, Stream.HAND)
            hand = self.hand or KinematicHand(self.world, own)
            episode = run_episode(self.world, hand, self.observer, self.agent, task, seed, say, exact)
            return dataclasses.replace(episode, own_wording=self._said_as_it_was)
        except (LayoutError, PhysicsError) as error:
            return Discarded(seed, str(error))

    def _paint(self, seed: int) -> Wording:
        """Choose what the scene's colours look like, and return the wording that says it."""
        if not self.config.survey_colors:
            return self.config.wording
        names = paint(self.world, make_task(self.config.task, self.config.split), seed)
        return dataclasses.replace(self.config.wording, synonyms=names)

    def _sentence(self, task: Task, wording: Wording, index: int) -> str:
        if not self.config.is_reworded:
            return task.instruction
        if task.sentence_slots:
            return wording.sentence(task.sentence_pattern, task.sentence_slots, index)
        self._said_as_it_was = True
        return task.instruction


def evaluate(
    config: EvaluateConfig,
    processes: int,
    journal: Journal,
    on_outcome: Callable[[Outcome], None],
    cluster: RayCluster | None = None,
) -> list[Outcome]:
    """Return the outcomes in the order of their seeds: those in the journal, and the others, which join it.

    on_outcome hears of each new one. cluster: where the scenes are spread over so many processes, instead of here.

    Raises:
        BenchmarkError: when the checkpoint cannot be used, a process died, or a scene failed; the others are done.
    """
    missing = [seed for seed in config.seeds if seed not in journal.outcomes]
    needed = () if config.checkpoint in BUILT_IN else (POLICY_MODULE,)
    set_up = partial(_set_up, config)
    with closing(run_parallel(_run, missing, processes, set_up, cluster, preload=needed)) as results:
        for _, outcome in results:
            if isinstance(outcome, str):
                raise BenchmarkError(outcome)
            journal.add(outcome)
            on_outcome(outcome)
    return [journal.outcomes[seed] for seed in config.seeds]


def _check_workspace(agent: Agent, config: EvaluateConfig) -> None:
    """Raise OptionError where a policy was trained for another workspace."""
    if isinstance(agent, PolicyAgent) and agent.policy.workspace != config.setup.workspace:
        raise OptionError(
            f"{config.checkpoint} was trained for {agent.policy.workspace}, not for {config.setup.workspace}: "
            "give that one's file as --workspace, or train a policy on data of yours"
        )


_evaluator: Evaluator | str | None = None  # of this worker process; a string says why there is none


def _set_up(config: EvaluateConfig) -> None:
    global _evaluator
    cv2.setNumThreads(1)
    try:
        if config.checkpoint not in BUILT_IN:
            import torch

            torch.set_num_threads(1)
        _evaluator = Evaluator(config)
    except (BenchmarkError, SimBridgeError) as error:
        _evaluator = str(error)


def _run(seed: int) -> Outcome | str:
    """Return an outcome, or the reason why there is none: errors cross processes as text."""
    if not isinstance(_evaluator, Evaluator):
        return _evaluator or "the worker was not set up"
    try:
        return _evaluator.run(seed)
    except (BenchmarkError, SimBridgeError) as error:
        return f"seed {seed}: {error}"
