"""The way of the arm back to its ready pose, from the request to its end, with every wait bounded; and letting go."""

from __future__ import annotations

from demo_tool.activity import StationHooks
from demo_tool.bulletin import Bulletin
from demo_tool.loss_watch import LossWatch
from demo_tool.ports import Arm
from demo_tool.station_config import StationConfig


class Recovery:
    """Recoveries of the arm, one at a time, each of which ends once whatever the arm does.

    The bulletin's lock guards it, and the bulletin is told what the executor says and how it ended. Times are those of
    a steady clock [s], handed in.
    """

    def __init__(self, arm: Arm, config: StationConfig, bulletin: Bulletin, hooks: StationHooks) -> None:
        self._arm, self._config, self._bulletin, self._hooks = arm, config, bulletin, hooks
        self._run: _Run | None = None

    @property
    def words(self) -> str:
        """Answer of the executor to the present recovery, as a phrase; "" without a recovery."""
        run = self._run
        return "" if run is None else run.words

    @property
    def is_needed(self) -> bool:
        """True if the arm was measured away from its ready pose, and nobody is known to move it but a recovery."""
        if self._hooks.is_home() is not False:
            return False
        return self._run is not None or not (self._arm.is_busy() or self._hooks.policy_moves())

    @property
    def held_width(self) -> float | None:
        """Width of what the hand still holds while the arm does nothing [m]; None where that is nothing."""
        return None if self._arm.is_busy() else self._arm.held_width()

    def open_hand(self) -> None:
        """Let go what the hand holds; to be called with the lock held, while nothing else goes on."""
        self._arm.open_hand(self._on_opening)

    def begin(self, now: float) -> None:
        """Ask the arm; to be called with the lock held, while nothing else goes on."""
        run = self._run = _Run(now, self._config.lost)
        self._bulletin.clear_failure()
        self._bulletin.touch()
        self._arm.recover(lambda ok, words: self._on_answer(run, ok, words), lambda: self._on_arrival(run))

    def stop(self, now: float) -> None:
        """Note that the arm was told to stop."""
        if self._run is not None and self._run.stopped_at is None:
            self._run.stopped_at = now

    def tick(self, now: float) -> None:
        """End a recovery that has lasted too long; to be called often."""
        run, limits = self._run, self._config
        if run is None:
            return
        fault = self._arm.fault()
        if run.loss.is_lost(fault, now):
            self._end(run, f"the arm was lost: {fault}")
        elif run.stopped_at is not None and now - run.stopped_at > limits.cancel_timeout:
            self._end(run, f"no end of it was seen for {limits.cancel_timeout:g} s after the stop: look at the arm")
        elif not run.begun and now - run.began > limits.answer_timeout:
            self._end(run, f"the executor gave no answer for {limits.answer_timeout:g} s: look whether the arm moves")
        elif now - run.began > limits.goal_timeout:
            self._end(run, f"it has not ended for {limits.goal_timeout:g} s: look at the arm, STOP stops it")

    def _on_opening(self, ok: bool, words: str) -> None:
        with self._bulletin.lock:
            if ok:
                self._bulletin.say("the hand opens")
            else:
                self._bulletin.fail(f"the hand did not open: {words}")

    def _on_answer(self, run: _Run, ok: bool, words: str) -> None:
        with self._bulletin.lock:
            if run is not self._run:
                return
            if not ok:
                self._end(run, words)
                return
            run.begun, run.words = True, words or "begun"
            self._bulletin.say(words)

    def _on_arrival(self, run: _Run) -> None:
        with self._bulletin.lock:
            if run is not self._run:
                return
            is_home = self._hooks.is_home()
            if is_home:
                self._end(run, "")
            elif run.stopped_at is not None:
                self._end(run, "stopped on the way; the arm holds")
            elif is_home is None:
                self._end(run, "it has ended, and no joint states say where the arm is")
            else:
                self._end(run, "it has ended elsewhere; the executor's log says why")

    def _end(self, run: _Run, failure: str) -> None:
        self._run = None
        if run.begun:
            self._hooks.on_rest()
        if failure:
            self._bulletin.fail(f"the arm did not recover: {failure}")
        else:
            self._bulletin.say("the arm is back at its ready pose")


class _Run:
    """One recovery; begun: whether the executor took it, so that the arm may have moved."""

    def __init__(self, began: float, lost: float) -> None:
        self.began, self.begun = began, False
        self.words = "asking the arm"
        self.stopped_at: float | None = None
        self.loss = LossWatch(lost)
