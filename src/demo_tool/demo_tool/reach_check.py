"""Check whether the arm can do what is drawn, made by itself once a drawing has been left alone for a moment."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult, Outcome
from demo_tool.activity import StationHooks
from demo_tool.bulletin import Bulletin
from demo_tool.ports import Arm
from demo_tool.wording import outcome_words

_PATIENCE = 0.5  # for the end of a check that gives way to a motion [s]
_NOT_FOUND_OUT = (Outcome.CANCELLED, Outcome.EXECUTION_FAILED)  # of a plan: nothing is known about the action


def plan_shown(result: ActionResult) -> dict[str, object] | None:
    """Return how a plan ended as the page shows it; None where it was not found out whether the arm can do it."""
    if result.outcome in _NOT_FOUND_OUT:
        return None
    return {"reachable": result.outcome is Outcome.PLANNED, "words": plan_words(result)}


def plan_words(result: ActionResult) -> str:
    """Return the words for how a plan ended."""
    return result.message or outcome_words(result.outcome)


class ReachCheck:
    """One check at a time, of the newest drawing; it ends at once when the arm is wanted.

    The bulletin's lock guards it. delay: for which a drawing must be left alone [s]; show: told what was found of the
    present drawing. Times are those of a steady clock [s], handed in.
    """

    def __init__(
        self,
        arm: Arm,
        delay: float,
        hooks: StationHooks,
        bulletin: Bulletin,
        show: Callable[[dict[str, object]], None],
    ) -> None:
        self._arm, self._delay, self._hooks, self._bulletin, self._show = arm, delay, hooks, bulletin, show
        self._drawing: Hashable = None  # the newest, None where there is nothing to ask
        self._due = float("inf")
        self._checks = 0  # so many were begun
        self._running = 0  # number of the check that has not ended, 0 for none
        self._asked: Hashable = None  # the drawing of that check
        self._next: Callable[[], None] | None = None  # what waits for the end of a check
        self._next_at = float("inf")  # when that is begun at the latest

    @property
    def is_free(self) -> bool:
        """True where nothing but a check keeps the arm from being asked."""
        taken = self._hooks.policy_moves() or (self._arm.is_busy() and not self._running)
        return not taken and self._arm.fault() is None

    def look(self, drawing: Hashable, now: float) -> bool:
        """Take what is drawn, None where there is nothing to ask; return True, once, when it is time to `ask`."""
        if self._next is not None and now > self._next_at:
            self._begin_next()
        if drawing != self._drawing:
            self._drawing, self._due = drawing, now + self._delay
            self._cancel()
        if drawing is None or now < self._due or self._running:
            return False
        self._due = float("inf")
        return True

    def ask(self, goal: ActionGoal) -> None:
        """Ask the arm about the present drawing."""
        self._checks += 1
        self._running, self._asked, number = self._checks, self._drawing, self._checks
        self._arm.check(goal, lambda result: self._on_end(number, result))

    def give_way(self, begin: Callable[[], None], now: float) -> None:
        """End the check and call `begin`, at once where none is running."""
        self._drawing, self._next, self._next_at = None, begin, now + _PATIENCE
        if self._running:
            self._cancel()
        else:
            self._begin_next()

    def _cancel(self) -> None:
        if self._running:
            self._arm.cancel_check()

    def _on_end(self, number: int, result: ActionResult) -> None:
        with self._bulletin.lock:
            if number != self._running:
                return
            self._running = 0
            plan = plan_shown(result)
            if self._next is not None:
                self._begin_next()
            elif self._drawing == self._asked and plan is not None and result.outcome is not Outcome.REJECTED:
                self._show(plan)

    def _begin_next(self) -> None:
        begin, self._next, self._running = self._next, None, 0
        if begin is not None:
            begin()
