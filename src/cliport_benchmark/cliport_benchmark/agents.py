"""Who decides in an evaluation: the expert, who knows the scene, or a policy, who sees the heightmap."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from cliport_benchmark.errors import OptionError
from cliport_perception import Heightmap, PlanarPose, Primitive
from cliport_policy.errors import PolicyError
from cliport_policy.policy import Policy, load_policy
from sim_bridge.tasks import Task

EXPERT = "expert"


@dataclass(frozen=True)
class Decision:
    """One pick and place in the base frame; done_probability: how likely the agent holds the goal reached."""

    pick: PlanarPose
    place: PlanarPose
    primitive: Primitive
    done_probability: float | None = None


class Agent(Protocol):
    """Decides what to do next."""

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Decision | None:
        """The next action; None when the agent sees nothing left to do."""


class ExpertAgent:
    """Asks the task."""

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Decision | None:
        """See Agent."""
        action = task.expert_action()
        return None if action is None else Decision(action.pick, action.place, action.primitive)


class PolicyAgent:
    """Asks a trained policy, which gets the observation and the sentence and nothing else.

    The primitive is not its choice: it is the task's.
    """

    def __init__(self, policy: Policy) -> None:
        self.policy = policy

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Decision | None:
        """See Agent."""
        action = self.policy.infer(observation, instruction)
        return Decision(action.pick, action.place, task.primitive, action.done_probability)


def load_agent(checkpoint: str) -> Agent:
    """The expert, or the policy of a path, a shipped name or `default`.

    Raises:
        OptionError: when the checkpoint cannot be used.
    """
    if checkpoint == EXPERT:
        return ExpertAgent()
    try:
        return PolicyAgent(load_policy(checkpoint))
    except PolicyError as error:
        raise OptionError(str(error)) from error
