"""Interfaces through which the station uses an arm and a policy: those of the graph, or of a test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult

OnPhase = Callable[[str, float], None]  # name of the phase as the executor gives it, share done
OnEnd = Callable[[ActionResult], None]
OnFailure = Callable[[str], None]  # one line for a person

ACCEPTED = "ACCEPTED"  # the phase that an arm reports when it has taken a goal
RESTING = frozenset({ACCEPTED, "VALIDATING", "GRASP_PLANNING", "APPROVAL"})  # phases in which nothing moves yet


class Arm(Protocol):
    """Interface of the executor. No method waits; answers come through the callbacks, from any thread."""

    def fault(self) -> str | None:
        """Return one line that says why the arm can take no goal now, or None."""

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        """Send a goal. The first phase is ACCEPTED; a refusal ends it with Outcome.REJECTED."""

    def cancel(self) -> None:
        """Cancel the present goal, if there is one."""

    def stop(self, reason: str, on_failure: OnFailure) -> None:
        """Cancel the goal, and refuse every goal, from whomever, until `resume`; on_failure: told if that fails."""

    def resume(self) -> None:
        """End a stop."""


class Policy(Protocol):
    """Interface of the policy server. No method waits; the station hears it by `on_policy_status` and `..._pose`."""

    def ask_require_approval(self, on_answer: Callable[[bool | None], None]) -> None:
        """Ask whether the server waits for approval before the arm moves; answers True, False or None (no answer)."""

    def instruct(self, text: str) -> None:
        """Send the policy an instruction; an empty one makes it drop its present one."""
