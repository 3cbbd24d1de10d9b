"""Signs of life of those who asked for a motion."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

_POLL = 0.06  # a longer pause between two looks is this process's own: it blames no owner [s]


class OwnerWatch:
    """Tells whether the owner of a goal lives; safe between threads.

    Silence is counted in looks: while nobody looks, nobody falls silent. Who was silent for too long stays so until the
    next goal begins: a late sign of life does not revive a goal that was told to end.

    Args:
        clock: steady time [s]; longest: silence of an owner that still lives [s].
    """

    def __init__(self, clock: Callable[[], float], longest: float) -> None:
        self._clock, self.longest = clock, longest
        self._lock = threading.Lock()
        self._silence: dict[str, float] = {}
        self._last_look = clock()

    def on_beat(self, owner: str) -> None:
        """Note a sign of life; it comes too late for an owner that was found silent."""
        with self._lock:
            if self._silence.get(owner, math.inf) <= self.longest:
                self._silence[owner] = 0.0

    def begin(self, owner: str) -> None:
        """Watch the owner of a goal that begins; an empty name is nobody."""
        with self._lock:
            self._silence = {owner: 0.0} if owner else {}
            self._last_look = self._clock()

    def is_silent(self, owner: str) -> bool:
        """Return True once the owner has been silent for too long; to be asked all the time."""
        with self._lock:
            now = self._clock()
            passed, self._last_look = min(now - self._last_look, _POLL), now
            if owner not in self._silence:
                return False
            self._silence[owner] += passed
            return self._silence[owner] > self.longest
