"""Signs of life of the guard, which stops the arm where this process cannot."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

from cliport_core.outcome import Refusal
from panda_executor.errors import RequestError

GUARD_STATUS = "panda_guard: arm"  # name of the status that the guard reports on /diagnostics once a second


class GuardWatch:
    """Tells whether a guard watches; safe between threads.

    Args:
        clock: steady time [s]; longest: between two reports of a guard that lives [s]; 0 asks for none.
    """

    def __init__(self, clock: Callable[[], float], longest: float) -> None:
        self._clock, self.longest = clock, longest
        self._lock = threading.Lock()
        self._heard = -math.inf

    def on_report(self) -> None:
        """Note that a guard reported."""
        with self._lock:
            self._heard = self._clock()

    def is_silent(self) -> bool:
        """Return True where a guard is asked for and none reported lately."""
        return 0.0 < self.longest < self._silence()

    def check(self) -> None:
        """Check that a guard watches.

        Raises:
            RequestError: when none reported lately.
        """
        if self.is_silent():
            silence = self._silence()
            heard = "has been heard yet" if math.isinf(silence) else f"was heard for {silence:.1f} s"
            raise RequestError(
                f"no guard {heard} (at most {self.longest:g} s): nobody would stop the arm if this process hung; run "
                "'ros2 run panda_executor guard', or start the executor with guard_silence:=0.0",
                Refusal.NO_GUARD,
                silence,
                self.longest,
            )

    def _silence(self) -> float:
        with self._lock:
            return self._clock() - self._heard
