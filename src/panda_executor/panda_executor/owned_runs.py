"""The run of an accepted goal: under its owner's and a guard's signs of life, shown, approved, until its end."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol

from cliport_core import topics
from cliport_core.heap import trim_heap
from cliport_core.outcome import ActionResult, Outcome, Refusal
from panda_executor.approvals import Approvals
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.guard_watch import GuardWatch
from panda_executor.motions import Motion
from panda_executor.owner_watch import OwnerWatch
from panda_executor.phase import Phase
from panda_executor.ports import ShouldStop

Publish = Callable[[Phase, float, str], None]  # a phase, the progress 0..1, the plan's id


class GoalHandle(Protocol):
    """The handle of an accepted goal, as an action's server has it."""

    @property
    def request(self) -> Any:
        """The goal's message."""

    @property
    def is_cancel_requested(self) -> bool:
        """True once its client wants it to end."""

    def succeed(self) -> None:
        """End it well."""

    def abort(self) -> None:
        """End it otherwise."""

    def canceled(self) -> None:
        """End it as its client asked for."""


class GoalFeedback:
    """Feedback to a goal's client: phases, with the id of the plan once there is one.

    Args:
        publish: to the client; on_phase: told of each phase, too.
        waits: whether the plan waits for its approval.
    """

    def __init__(
        self,
        publish: Publish,
        approvals: Approvals,
        waits: bool,
        should_stop: ShouldStop,
        on_phase: Callable[[Phase], None] = lambda phase: None,
    ) -> None:
        self._publish, self._approvals, self._waits, self._should_stop = publish, approvals, waits, should_stop
        self._on_phase = on_phase
        self._plan_id = ""

    def on_phase(self, phase: Phase, progress: float) -> None:
        """Tell of a phase and the progress 0..1."""
        self._on_phase(phase)
        self._publish(phase, progress, self._plan_id)

    def on_plan(self, motions: Sequence[Motion]) -> bool:
        """Show a plan; return once it may be executed, True where it waited for that. Raises RequestError."""
        self._plan_id = self._approvals.present(motions)
        if self._waits:
            self._approvals.offer(self._plan_id)
            self.on_phase(Phase.APPROVAL, Phase.APPROVAL.progress())
            self._approvals.wait(self._plan_id, self._should_stop)
        return self._waits


class Watchers(NamedTuple):
    """Watchers of those who are to live while the arm moves."""

    owners: OwnerWatch
    guard: GuardWatch


class OwnedRuns:
    """Runs accepted goals, one at a time; one whose owner or guard falls silent is told to end.

    Args:
        require_owner: whether goals that move the arm must name one.
    """

    def __init__(self, gate: Gate, watchers: Watchers, require_owner: bool) -> None:
        self._gate, self._owners, self._guard, self._require_owner = gate, *watchers, require_owner
        self._needs_guard = self._guard_lost = False

    def run(self, handle: GoalHandle, logger: Any, act: Callable[[ShouldStop], ActionResult]) -> ActionResult:
        """Return how `act` ended, once the handle is in its final state. act: polls what it is given all the time."""
        began = time.monotonic()
        owner = str(handle.request.owner)
        self._owners.begin(owner)
        self._needs_guard = self._guard_lost = False

        def should_stop() -> bool:
            stopped = self._gate.stopped or bool(handle.is_cancel_requested)
            return stopped or self._owners.is_silent(owner) or self._lacks_guard()

        try:
            result = act(should_stop)
        except RequestError as error:
            result = ActionResult(
                Outcome.REJECTED,
                str(error),
                refusal=error.refusal,
                refusal_value=error.value,
                refusal_limit=error.limit,
            )
        except Exception as error:  # the goal must end whatever happens, with a line that names the fault
            logger.error(f"unexpected {type(error).__name__}: {error}")
            result = ActionResult(Outcome.EXECUTION_FAILED, f"internal error: {type(error).__name__}: {error}")
        was_stopped = result.outcome is Outcome.CANCELLED or result.refusal is Refusal.NOT_APPROVED
        if was_stopped and self._owners.is_silent(owner):
            words = f"the goal's owner gave no sign of life for {self._owners.longest:g} s: {result.message}"
            result = replace(result, message=words, refusal=Refusal.OWNER_SILENT, refusal_limit=self._owners.longest)
        elif was_stopped and self._lacks_guard():
            words = f"no guard was heard for {self._guard.longest:g} s: {result.message}"
            result = replace(result, message=words, refusal=Refusal.NO_GUARD, refusal_limit=self._guard.longest)
        took = time.monotonic() - began
        logger.info(f"{result.outcome.name} after {took:.1f} s: {result.message}")
        if result.outcome.is_success:
            handle.succeed()
        elif result.outcome is Outcome.CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        trim_heap()  # a search that took long took memory, too
        return result

    def need_guard(self) -> None:
        """Check that a guard watches; where it falls silent from now on, the running goal ends. Raises RequestError."""
        self._guard.check()
        self._needs_guard = True

    def _lacks_guard(self) -> bool:
        """Return True once the guard fell silent: a late report does not revive a goal that was told to end."""
        self._guard_lost = self._guard_lost or (self._needs_guard and self._guard.is_silent())
        return self._guard_lost

    def check(self, owner: str, plan_only: bool) -> None:
        """Check that a goal that moves the arm names its owner. Raises RequestError."""
        if self._require_owner and not owner and not plan_only:
            raise RequestError(
                "the goal names no owner: its motion would go on if whoever asked for it died; name one and give its "
                f"signs of life on {topics.OWNER_HEARTBEAT}, or start the executor with require_owner:=false",
                Refusal.NO_OWNER,
            )
