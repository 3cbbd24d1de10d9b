"""Interfaces through which the station uses an arm and a policy: those of the graph, or of a test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult

OnEnd = Callable[[ActionResult], None]
OnFailure = Callable[[str], None]  # one line for a person
OnAnswer = Callable[[bool, str], None]  # True if it is done or begun as asked, and one line for a person
OnLine = Callable[[str], None]  # one line that a person would read
OnLessonEnd = Callable[[int, dict[str, Any] | None], None]  # exit status, and the report of `learn` where there is one

ACCEPTED = "ACCEPTED"  # the phase that an arm reports when it has taken a goal
APPROVAL = "APPROVAL"  # the phase in which a plan waits for a person's approval
RESTING = frozenset({ACCEPTED, "VALIDATING", "GRASP_PLANNING", APPROVAL})  # phases in which nothing moves yet


class OnPhase(Protocol):
    """Callback for a phase of a goal."""

    def __call__(self, name: str, progress: float, plan_id: str = "") -> None:
        """Take the phase as the executor names it, the share done, and the id of the goal's plan, "" before one."""


class Arm(Protocol):
    """Interface of the executor. No method waits; answers come through the callbacks, from any thread."""

    def fault(self) -> str | None:
        """Return one line that says why the arm can take no goal now, or None."""

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        """Send a goal. The first phase is ACCEPTED; a refusal ends it with Outcome.REJECTED."""

    def cancel(self) -> None:
        """Cancel the present goal, if there is one."""

    def check(self, goal: ActionGoal, on_end: OnEnd) -> None:
        """Plan a goal without moving, beside `send`; only where nothing else is asked of the arm."""

    def cancel_check(self) -> None:
        """Cancel the check, if there is one."""

    def approve(self, plan_id: str, on_answer: OnAnswer) -> None:
        """Approve the plan of that id, and no other; on_answer: told what the executor says to that."""

    def recover(self, on_answer: OnAnswer, on_end: Callable[[], None]) -> None:
        """Begin to move the arm up and back to its ready pose, which only a stop ends early.

        on_answer: told whether that has begun; on_end: told, if it has, once the executor does nothing any more.
        """

    def open_hand(self, on_answer: OnAnswer) -> None:
        """Begin to open the hand where it is; on_answer: told whether that has begun."""

    def held_width(self) -> float | None:
        """Return how wide is what the hand holds [m], as the executor said last; None where that is nothing."""

    def is_busy(self) -> bool:
        """Return True if the executor said last that it does something, for whomever."""

    def stop(self, reason: str, on_failure: OnFailure) -> None:
        """Cancel the goal, and refuse every goal, from whomever, until `resume`; on_failure: told if that fails."""

    def resume(self) -> None:
        """End a stop."""


class Scenes(Protocol):
    """Interface of a simulator that can make another scene. No method waits; the answer comes from any thread."""

    def are_offered(self) -> bool:
        """Return True if there is such a simulator."""

    def change(self, on_answer: OnAnswer) -> None:
        """Make another scene of the same task; on_answer: told the sentence asked for there, or why there is none."""


class Lessons(Protocol):
    """Interface of what learns from episodes. Only `close` waits; the callbacks come from another thread."""

    def begin(self, data_set: Path, options: Sequence[str], on_line: OnLine, on_end: OnLessonEnd) -> None:
        """Learn from the episodes of a data set's folder with options of `learn`. Raises NotNowError."""

    def stop(self) -> None:
        """Save what is learned and end; begun again, it goes on."""

    def close(self) -> None:
        """Stop, and wait for the end."""


class Calibrations(Protocol):
    """Interface of what calibrates the camera. Only `close` waits; the callbacks come from another thread."""

    def begin(self, options: Sequence[str], on_line: OnLine, on_end: Callable[[int], None]) -> None:
        """Calibrate with options of `calibrate`; on_end: told the exit status. Raises NotNowError."""

    def stop(self) -> None:
        """End it, with nothing saved."""

    def close(self) -> None:
        """Stop, and wait for the end."""


class Programs(NamedTuple):
    """The programs that the station runs: what learns, what calibrates."""

    lessons: Lessons
    calibrations: Calibrations


class Policy(Protocol):
    """Interface of the policy server. No method waits; the station hears it by `on_policy_status` and `..._pose`."""

    def ask_require_approval(self, on_answer: Callable[[bool | None], None]) -> None:
        """Ask whether the server waits for approval before the arm moves; answers True, False or None (no answer)."""

    def instruct(self, text: str) -> None:
        """Send the policy an instruction; an empty one makes it drop its present one."""

    def load(self, checkpoint: str, on_answer: OnAnswer) -> None:
        """Have the server load another policy; on_answer: told whether that has begun, its status says how it ends."""
