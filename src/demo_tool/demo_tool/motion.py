"""One goal of the arm, from its request to its end, with every wait bounded."""

from __future__ import annotations

import threading
from collections.abc import Callable

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult, Outcome
from demo_tool.loss_watch import LossWatch
from demo_tool.ports import ACCEPTED, APPROVAL, RESTING, Arm, OnEnd
from demo_tool.station_config import StationConfig

_ENDED_MOVING = frozenset({Outcome.SUCCEEDED, Outcome.GRASP_MISSED, Outcome.DROPPED})


class Motion:
    """One goal of the arm, which ends once whatever the arm does.

    `on_end` is called with the result, in the thread that brings it; `on_change` after every phase. Times are those of
    a steady clock [s], handed in.
    """

    def __init__(
        self, arm: Arm, goal: ActionGoal, config: StationConfig, on_change: Callable[[], None], on_end: OnEnd
    ) -> None:
        self.goal = goal
        self.phase, self.progress = "", 0.0
        self.moved = False
        self._arm, self._config = arm, config
        self._on_change, self._on_end = on_change, on_end
        self._lock = threading.Lock()
        self._ended = False
        self._accepted = False
        self._deadline = float("inf")
        self._cancelled_at: float | None = None
        self._loss = LossWatch(config.lost)
        self._plan_id = ""

    @property
    def waiting_plan(self) -> str:
        """Id of the plan that waits for a person's approval; "" while none does."""
        is_waiting = self.phase == APPROVAL and not self._ended and self._cancelled_at is None
        return self._plan_id if is_waiting else ""

    def begin(self, now: float) -> None:
        """Send the goal to the arm, unless it was cancelled before."""
        if self._cancelled_at is not None:
            self.abandon("stopped before anything moved")
            return
        self._deadline = now + self._config.answer_timeout
        self._arm.send(self.goal, self._on_phase, self._end)

    def cancel(self, now: float) -> None:
        """Cancel the goal; the result is CANCELLED even when the arm no longer answers."""
        if self._cancelled_at is None:
            self._cancelled_at = now
            self._arm.cancel()

    def abandon(self, message: str) -> None:
        """End before the goal was sent to the arm."""
        self._end(ActionResult(Outcome.CANCELLED, message))

    def tick(self, now: float) -> None:
        """End a goal that has waited too long; to be called often."""
        if self._ended:
            return
        if self.waiting_plan:
            self._deadline = now  # the time that a person takes is not the motion's: the executor limits it
        fault = self._arm.fault()
        if self._loss.is_lost(fault, now):
            self._give_up(Outcome.EXECUTION_FAILED, f"the arm was lost: {fault}")
        elif self._cancelled_at is not None and now - self._cancelled_at > self._config.cancel_timeout:
            self._give_up(Outcome.CANCELLED, f"no answer to a cancel for {self._config.cancel_timeout:g} s")
        elif now > self._deadline and not self._accepted:
            self._give_up(Outcome.REJECTED, f"the executor gave no answer for {self._config.answer_timeout:g} s")
        elif self._accepted and now > self._deadline + self._config.goal_timeout:
            self.cancel(now)

    def _give_up(self, outcome: Outcome, message: str) -> None:
        self._arm.cancel()  # the arm may still receive it
        self._end(ActionResult(outcome, message))

    def _on_phase(self, name: str, progress: float, plan_id: str = "") -> None:
        if self._ended:
            return
        self._accepted = True
        self._plan_id = plan_id
        if name not in RESTING and not self.goal.plan_only:
            self.moved = True
        if name != ACCEPTED:
            self.phase, self.progress = name, progress
        self._on_change()

    def _end(self, result: ActionResult) -> None:
        with self._lock:
            if self._ended:
                return
            self._ended = True
        self.moved = self.moved or result.outcome in _ENDED_MOVING
        self._on_end(result)
