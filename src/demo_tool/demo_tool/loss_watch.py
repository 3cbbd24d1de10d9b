"""Watch over the arm's faults: one that lasts counts as a loss of the arm."""

from __future__ import annotations


class LossWatch:
    """Watch over one request's arm; lasting: time after which a fault counts as a loss [s]."""

    def __init__(self, lasting: float) -> None:
        self._lasting = lasting
        self._since: float | None = None

    def is_lost(self, fault: str | None, now: float) -> bool:
        """Take the arm's present fault, None without one; return True if there was one at each call for long enough.

        now: a steady clock's time [s].
        """
        if fault is None:
            self._since = None
            return False
        if self._since is None:
            self._since = now
        return now - self._since >= self._lasting
