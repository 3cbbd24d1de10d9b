"""A sign of life to the arm's side, many times a second, from the process that commands it."""

from __future__ import annotations

import threading
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


class Heartbeat:
    """Calls `beat` every `period` s from a thread of its own: planning in another thread does not hold it up.

    The arm's side stops the arm when the beats end during a motion: a process that was killed cannot cancel.

    Args:
        is_alive: whether the work goes on; no beat while it does not.
    """

    def __init__(
        self, beat: Callable[[], None], period: float = 0.05, is_alive: Callable[[], bool] = lambda: True
    ) -> None:
        self._beat, self._period, self._is_alive = beat, period, is_alive
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(self._period):
            if self._is_alive():
                self._beat()

    def stop(self) -> None:
        """End the thread; returns when no beat is under way."""
        self._end.set()
        self._thread.join(timeout=1.0)
