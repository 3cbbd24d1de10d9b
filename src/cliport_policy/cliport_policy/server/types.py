"""The policy server's types: groups of states, limits, moments, answers and ports."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Protocol

from cliport_core.action import ActionGoal
from cliport_core.outcome import Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_policy.errors import ConfigError

BUSY = (
    PolicyState.OBSERVING,
    PolicyState.PROPOSING,
    PolicyState.WAITING_FOR_APPROVAL,
    PolicyState.EXECUTING,
)
TRY_AGAIN = (Outcome.GRASP_MISSED, Outcome.DROPPED)


@dataclass(frozen=True)
class ServerConfig:
    """Limits of the server; all times [s].

    done_threshold: done probability from which the goal counts as reached (a card's done_bias shifts these);
    absent_threshold: probability from which what the sentence names counts as not there; min_confidence: of pick and
    place; retries: how often in a row a missed or dropped object is tried again; settle: rest after a motion;
    max_proposal_age: how old an observation may be when its proposal is approved; look_back: how much older than the
    instruction it may be, for replays, whose scene nobody rearranges.
    """

    max_steps: int = 20
    require_approval: bool = False
    done_threshold: float = 0.5
    absent_threshold: float = 0.5
    min_confidence: float = 0.02
    retries: int = 2
    max_observation_age: float = 1.0
    look_back: float = 0.0
    observation_timeout: float = 3.0
    settle: float = 0.2
    inference_timeout: float = 30.0
    max_proposal_age: float = 60.0
    executor_timeout: float = 5.0
    heartbeat_timeout: float = 1.0
    goal_timeout: float = 120.0
    cancel_timeout: float = 5.0

    def __post_init__(self) -> None:
        if self.max_steps < 1 or self.retries < 0:
            raise ConfigError(f"max_steps must be >= 1 and retries >= 0, got {self.max_steps}, {self.retries}")
        for name in ("settle", "look_back"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ConfigError(f"{name} must be 0 or more and finite [s], got {getattr(self, name)}")
        for name in ("done_threshold", "absent_threshold", "min_confidence"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ConfigError(f"{name} must be in 0..1, got {getattr(self, name)}")
        for name in (f.name for f in fields(self) if f.name.endswith(("_timeout", "_age"))):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} must be positive, got {getattr(self, name)}")


class Moment(NamedTuple):
    """One instant on two clocks: wall [s], monotonic, for time-outs; ros_ns [ns] for the age of data."""

    wall: float
    ros_ns: int


class Answer(NamedTuple):
    """The answer to a service call: success, and one line."""

    success: bool
    message: str


class ServerEffects(Protocol):
    """Effects of the server on the world, and its inferences; the token of an inference comes back with it."""

    def publish_status(self, status: ServerStatus) -> None:
        """Publish a status."""

    def publish_proposal(self, goal: ActionGoal) -> None:
        """Publish what the policy proposes."""

    def start_inference(self, token: int, observation: Any, instruction: str) -> None:
        """Start an inference; its answer comes later, with the token."""


class ExecutorPort(Protocol):
    """The executor, asked without waiting: its answers come as events that carry the goal's token."""

    def is_ready(self) -> bool:
        """Return True if the executor is there."""

    def send(self, token: int, goal: ActionGoal) -> None:
        """Ask for a goal."""

    def cancel(self, token: int) -> None:
        """Ask for a goal's end."""

    def stop(self) -> bool:
        """Ask for a stop that holds until `resume`; return whether the executor is there to be asked."""

    def resume(self) -> bool:
        """End a stop; return whether the executor is there to be asked."""

    def approve(self, plan_id: str) -> bool:
        """Ask the executor to run its plan of that id; return whether the executor is there to be asked."""
