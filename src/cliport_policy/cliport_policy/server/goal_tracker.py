"""One goal at the executor, from asking to its end, with every wait bounded."""

from __future__ import annotations

from enum import Enum

from cliport_core import topics
from cliport_core.action import ActionGoal
from cliport_policy.server.types import ExecutorPort, Moment, ServerConfig

_STALL = 0.2  # a longer pause between ticks was our own; the executor is not to blame for it [s]


class GoalPhase(Enum):
    """Phases of a goal; the value says what is waited for."""

    NONE = "nothing"
    WAITING = "the executor to appear"
    SENT = "the executor's answer"
    ACCEPTED = "the result"
    CANCELLING = "the cancel to be confirmed"


class GoalTracker:
    """Sends a goal when the executor is there, watches its signs of life, and cancels."""

    def __init__(self, config: ServerConfig, executor: ExecutorPort) -> None:
        self._config = config
        self._executor = executor
        self.phase = GoalPhase.NONE
        self._token = 0
        self._deadline = 0.0  # wall clock
        self._goal: ActionGoal | None = None
        self._heartbeat: float | None = None  # last sign of life, wall clock; None: it has never given one
        self._last_tick: float | None = None
        self._executor_phase = ""

    def begin(self, goal: ActionGoal, now: Moment) -> None:
        """Send a goal, as soon as the executor is there. Only when the phase is NONE."""
        self._goal = goal
        self._token += 1
        self._executor_phase = ""
        self._wait_in(GoalPhase.WAITING, now, self._config.executor_timeout)
        if self._executor.is_ready():
            self._send(now)

    def cancel(self, now: Moment) -> None:
        """Ask for the goal's end, when there is one."""
        if self.phase == GoalPhase.WAITING:
            self.phase = GoalPhase.NONE
        elif self.phase in (GoalPhase.SENT, GoalPhase.ACCEPTED):
            self._executor.cancel(self._token)
            self._wait_in(GoalPhase.CANCELLING, now, self._config.cancel_timeout)

    def on_heartbeat(self, now: Moment) -> None:
        """Note that the executor lives."""
        self._heartbeat = now.wall

    def on_response(self, token: int, accepted: bool, now: Moment) -> bool:
        """Note that the executor took the goal or not; return True if this ended a goal."""
        if token != self._token or self.phase not in (GoalPhase.SENT, GoalPhase.CANCELLING):
            if accepted and not (token == self._token and self.phase == GoalPhase.ACCEPTED):
                self._executor.cancel(token)  # it was given up meanwhile, and must not run without anyone's care
            return False
        if not accepted:
            self.phase = GoalPhase.NONE
            return True
        if self.phase == GoalPhase.CANCELLING:
            self._executor.cancel(token)  # asked for before there was anything to cancel
            return False
        self._wait_in(GoalPhase.ACCEPTED, now, self._config.goal_timeout)
        if self._heartbeat is not None:
            self._heartbeat = now.wall
        return False

    def on_feedback(self, token: int, phase: str, now: Moment) -> bool:
        """Note the executor's phase; return True if that is news."""
        if self._heartbeat is not None:
            self._heartbeat = now.wall
        if token != self._token or self.phase != GoalPhase.ACCEPTED or phase == self._executor_phase:
            return False
        self._executor_phase = phase
        return True

    def on_result(self, token: int) -> bool:
        """Note that the executor is through with a goal; return True if this ended the tracked one."""
        if token != self._token or self.phase in (GoalPhase.NONE, GoalPhase.WAITING):
            return False
        self.phase = GoalPhase.NONE
        return True

    def tick(self, now: Moment) -> str | None:
        """Return why the goal failed, once; call often. It may then still be CANCELLING."""
        pause = now.wall - self._last_tick if self._last_tick is not None else 0.0
        self._last_tick = now.wall
        if self._heartbeat is not None and pause > _STALL:
            self._heartbeat += pause
        if self.phase == GoalPhase.NONE:
            return None
        if self.phase == GoalPhase.WAITING and self._executor.is_ready():
            self._send(now)
        if self.phase == GoalPhase.ACCEPTED and (reason := self._silence(now)) is not None:
            self._executor.cancel(self._token)
            self.phase = GoalPhase.NONE
            return f"executor lost: {reason} during {self._executor_phase or 'the start'}"
        return self._time_out(now) if now.wall >= self._deadline else None

    def _silence(self, now: Moment) -> str | None:
        if not self._executor.is_ready():
            return "its action server is gone"
        if self._heartbeat is not None and now.wall - self._heartbeat > self._config.heartbeat_timeout:
            return f"no heartbeat for {self._config.heartbeat_timeout:.1f} s"
        return None

    def _time_out(self, now: Moment) -> str:
        phase, config = self.phase, self._config
        if phase == GoalPhase.ACCEPTED:
            self.cancel(now)
            return f"the executor was not done after {config.goal_timeout:.0f} s: cancelled"
        self.phase = GoalPhase.NONE
        if phase == GoalPhase.CANCELLING:
            return f"executor lost: no answer to a cancel for {config.cancel_timeout:.1f} s"
        what = "not there" if phase == GoalPhase.WAITING else "not answering"
        return f"the executor is {what} ({config.executor_timeout:.1f} s): is it running? (action {topics.PICK_PLACE})"

    def _send(self, now: Moment) -> None:
        if self._goal is not None:
            self._wait_in(GoalPhase.SENT, now, self._config.executor_timeout)
            self._executor.send(self._token, self._goal)

    def _wait_in(self, phase: GoalPhase, now: Moment, timeout: float) -> None:
        self.phase, self._deadline = phase, now.wall + timeout
