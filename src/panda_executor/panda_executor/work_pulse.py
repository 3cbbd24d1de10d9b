"""Looks at what is owned: whether somebody still watches a motion."""

from __future__ import annotations

from collections.abc import Callable


class WorkPulse:
    """Tells whether what is owned is being watched: alive while nothing runs, or while looks at it go on.

    A thread that only lives says nothing about the one that watches a motion. Safe between threads.

    Args:
        clock: steady time [s]; longest: between two looks [s].
    """

    def __init__(self, clock: Callable[[], float], longest: float) -> None:
        self._clock, self._longest = clock, longest
        self._running = 0
        self._last = clock()

    def begin(self) -> None:
        """Note that something runs from now on."""
        self._last = self._clock()
        self._running += 1

    def beat(self) -> None:
        """Note a look at what runs."""
        self._last = self._clock()

    def end(self) -> None:
        """Note that it is over."""
        self._running -= 1

    def is_alive(self) -> bool:
        """Return True unless something runs that nobody has looked at for too long."""
        return self._running == 0 or self._clock() - self._last <= self._longest
