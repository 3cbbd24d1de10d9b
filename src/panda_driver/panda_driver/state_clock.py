"""The age of the arm's states, told from the arm's own clock."""

from __future__ import annotations

_MOST_DRIFT = 1e-3  # of the arm's clock against this machine's, as a share; quartz clocks stay below 1e-4


class StateClock:
    """Maps the arm's clock to this machine's steady one.

    A state that was long on its way comes late and never early. So the offset between the clocks is the least that
    was seen, and an old state is never taken for a new one. The least is let go slowly, because the clocks drift.
    """

    def __init__(self) -> None:
        self._offset = 0.0
        self._arm_time = self._seen_at = 0.0
        self._began = False

    def age(self, arm_time: float, now: float) -> float | None:
        """Return how old [s] a state of the arm's time [s] is that was read at `now` [s, steady clock].

        None for a state that came before: the arm's time did not go on since.
        """
        if self._began and arm_time == self._arm_time:
            return None
        offset = now - arm_time
        if self._began and arm_time > self._arm_time:  # else the arm's clock began anew
            offset = min(offset, self._offset + _MOST_DRIFT * (now - self._seen_at))
        self._began, self._offset, self._arm_time, self._seen_at = True, offset, arm_time, now
        return now - arm_time - offset
