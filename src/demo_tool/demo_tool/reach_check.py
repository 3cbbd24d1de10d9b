"""Whether the arm can do what is drawn, asked by itself once a drawing has been left alone for a moment."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult
from demo_tool.ports import Arm

_PATIENCE = 0.5  # for the end of a check that gives way to a motion [s]


class ReachCheck:
    """At most one check, of the newest drawing; it ends at once when the arm is wanted. The bulletin's lock guards it.

    delay: for which a drawing must be left alone [s]; on_result: told how the check of the present drawing ended. Times
    are those of a steady clock [s], handed in.
    """

    def __init__(self, arm: Arm, delay: float, on_result: Callable[[ActionResult], None]) -> None:
        self._arm, self._delay, self._on_result = arm, delay, on_result
        self._drawing: Hashable = None  # the newest, None where there is nothing to ask
        self._due = float("inf")
        self._checks = 0  # so many were begun
        self._running = 0  # number of the check that has not ended, 0 for none
        self._next: Callable[[], None] | None = None  # what waits for the end of a check
        self._next_at = float("inf")  # when that is begun at the latest

    @property
    def is_running(self) -> bool:
        """True while the arm is asked."""
        return self._running > 0

    def look(self, drawing: Hashable, now: float) -> bool:
        """Take what is drawn, None where there is nothing to ask; return True when it is time to `ask` about it."""
        if self._next is not None and now > self._next_at:
            self._begin_next()
        if drawing != self._drawing:
            self._drawing, self._due = drawing, now + self._delay
            self._cancel()
        return drawing is not None and now >= self._due and not self._running

    def ask(self, goal: ActionGoal) -> None:
        """Ask the arm about the present drawing, once."""
        self._due = float("inf")
        self._checks += 1
        self._running, number = self._checks, self._checks
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
        """Take the end of a check, with the lock held."""
        if number != self._running:
            return
        self._running = 0
        if self._next is not None:
            self._begin_next()
        elif self._drawing is not None and self._due == float("inf"):
            self._on_result(result)

    def _begin_next(self) -> None:
        begin, self._next, self._running = self._next, None, 0
        if begin is not None:
            begin()
