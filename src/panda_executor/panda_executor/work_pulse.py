"""The condition of the executor's heartbeat: a goal that runs is being watched, and its callbacks are delivered."""

from __future__ import annotations

import math
from collections.abc import Callable


class WorkPulse:
    """Tells whether a goal that runs is being watched; alive while none runs.

    The thread of the heartbeat says nothing about the one that watches a motion, nor about the one that spins the node:
    both tell this. Safe between threads.

    Args:
        clock: steady time [s]; longest: between two looks at the goal, and two turns of the spinning thread [s].
    """

    def __init__(self, clock: Callable[[], float], longest: float) -> None:
        self._clock, self._longest = clock, longest
        self._running = False
        self._last = clock()
        self._last_turn: float | None = None

    def begin(self) -> None:
        """Note that something runs from now on."""
        self._last = self._clock()
        self._running = True

    def beat(self) -> None:
        """Note a look at what runs."""
        self._last = self._clock()

    def end(self) -> None:
        """Note that it is known to be over."""
        self._running = False

    def lapse(self) -> None:
        """Note that it did not end when it was told to: no sign of life until its end is known, or another begins."""
        self._last = -math.inf

    def turn(self) -> None:
        """Note that the thread that delivers callbacks goes round; it is watched from the first call on."""
        self._last_turn = self._clock()

    def is_alive(self) -> bool:
        """Return False where something runs that nobody has looked at, or whose end nobody can hear, for too long."""
        if not self._running:
            return True
        now, turned = self._clock(), self._last_turn
        return now - self._last <= self._longest and (turned is None or now - turned <= self._longest)
