"""Approval of plans by their ids."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from cliport_core import topics
from cliport_core.new_id import new_id
from cliport_core.outcome import Refusal
from panda_executor.errors import RequestError
from panda_executor.motions import Motion
from panda_executor.ports import ShouldStop

Show = Callable[[str, Sequence[Motion]], None]


def _nowhere(_: str, __: Sequence[Motion]) -> None:
    """Show a plan to nobody."""


class Approvals:
    """Shows plans, and holds one at a time until a person approves it; an approval is of that plan and of no other.

    Args:
        seconds: a plan waits for at most; clock: steady time [s]; show: publishes the motions of the plan of that id.
    """

    def __init__(self, seconds: float, clock: Callable[[], float] = time.monotonic, show: Show = _nowhere) -> None:
        self._seconds, self._clock, self._show = seconds, clock, show
        self._changed = threading.Condition()
        self._waiting = ""
        self._approved = ""

    def present(self, motions: Sequence[Motion]) -> str:
        """Show a plan to whoever wants to see it; return its id."""
        plan_id = new_id()
        self._show(plan_id, motions)
        return plan_id

    def offer(self, plan_id: str) -> None:
        """Let the plan of that id be approved from now on, in place of any other."""
        with self._changed:
            self._waiting, self._approved = plan_id, ""

    def approve(self, plan_id: str) -> tuple[bool, str]:
        """Take an approval of the plan of that id; return whether that one waits, and a sentence."""
        with self._changed:
            if not self._waiting:
                return False, "no plan waits for approval"
            if plan_id != self._waiting:
                return False, f"the plan that waits is {self._waiting}, not {plan_id or 'one without an id'}"
            self._approved = plan_id
            self._changed.notify_all()
            return True, f"plan {plan_id} is approved"

    def wait(self, plan_id: str, should_stop: ShouldStop) -> None:
        """Wait until the plan is approved: it may be executed where this returns, and only there.

        Raises:
            RequestError: when nobody approved it in time, or before a stop was asked for.
        """
        deadline = self._clock() + self._seconds
        with self._changed:
            try:
                while self._approved != plan_id:
                    if should_stop():
                        words = f"plan {plan_id} was not approved before a stop was asked for"
                        raise RequestError(words, Refusal.NOT_APPROVED)
                    if self._clock() > deadline:
                        raise RequestError(
                            f"plan {plan_id} was not approved within {self._seconds:g} s (service "
                            f"{topics.EXECUTOR_APPROVE}); nothing moved",
                            Refusal.NOT_APPROVED,
                            self._seconds,
                            self._seconds,
                        )
                    self._changed.wait(0.02)
            finally:
                self._waiting = ""
