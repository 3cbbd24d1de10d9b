"""Agents that an evaluation asks: the expert and the blind agent, who both know the scene, or a policy, who sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from cliport_benchmark.errors import OptionError
from cliport_core import Heightmap, PickPlaceAction
from cliport_policy.errors import PolicyError
from sim_bridge.task_mechanics.blind import BlindChooser
from sim_bridge.tasks import Task
from sim_bridge.world import SimWorld

if TYPE_CHECKING:
    from cliport_policy.policy import Policy

EXPERT = "expert"
BLIND = "blind"
BUILT_IN = (EXPERT, BLIND)  # agents without weights
POLICY_MODULE = "cliport_policy.policy"  # what processes import that ask a policy

Answer: TypeAlias = tuple[PickPlaceAction | None, float | None]


class Agent(Protocol):
    """Decides what to do next."""

    def new_scene(self, task: Task, world: SimWorld, rng: np.random.Generator) -> None:
        """Take note that the world was reset to a task; rng draws the choices of an agent that makes any."""

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        """Return the next action, None where the agent sees nothing left to do, and how likely it holds the goal
        reached, 0..1, None where it does not say."""


class ExpertAgent:
    """Agent that asks the task for its expert's action."""

    def new_scene(self, task: Task, world: SimWorld, rng: np.random.Generator) -> None:
        """Forget nothing: the task knows its scene."""

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        """Return the expert's action, without a probability."""
        return task.expert_action(), None


class BlindAgent:
    """Agent that moves things as well as the expert, but does not hear the sentence (docs/benchmark.md, "Chance")."""

    def __init__(self) -> None:
        self._chooser: BlindChooser | None = None

    def new_scene(self, task: Task, world: SimWorld, rng: np.random.Generator) -> None:
        """Begin to choose in a new scene; rng draws the choices."""
        self._chooser = BlindChooser(task, world, rng)

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        """Return the next action that looks right without the sentence."""
        return (self._chooser.action() if self._chooser else None), None


class PolicyAgent:
    """Agent that asks a trained policy, which gets the observation and the sentence and nothing else."""

    def __init__(self, policy: Policy) -> None:
        self.policy = policy

    def new_scene(self, task: Task, world: SimWorld, rng: np.random.Generator) -> None:
        """Forget nothing: a policy remembers no scene."""

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        """Return the policy's action and how likely it holds the goal reached."""
        inference = self.policy.infer(observation, instruction)
        return inference.action, inference.done_probability


def load_agent(checkpoint: str, left_out: tuple[str, ...] = ()) -> Agent:
    """Load an agent: the expert, the blind one, or the policy of a path, a shipped name or `default`.

    left_out: parts of the policy's network that it acts without.

    Raises:
        OptionError: when the checkpoint cannot be used.
    """
    if checkpoint == EXPERT:
        return ExpertAgent()
    if checkpoint == BLIND:
        return BlindAgent()
    from cliport_policy.policy import load_policy  # takes seconds, and the agents without weights do without

    try:
        return PolicyAgent(load_policy(checkpoint, left_out=left_out))
    except PolicyError as error:
        raise OptionError(str(error)) from error
