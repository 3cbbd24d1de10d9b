"""The time in a bag while it is played: it runs at a rate, can be paused, and can be waited for."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

SECOND = 1_000_000_000  # ns


Wait = Callable[[threading.Condition, float | None], object]


class PlaybackClock:
    """Bag time in nanoseconds. `rate` is bag seconds a second.

    `steady` tells a steady time in nanoseconds, and `wait` waits on a condition for some of its seconds.
    """

    def __init__(
        self,
        rate: float,
        paused: bool = False,
        steady: Callable[[], int] = time.monotonic_ns,
        wait: Wait = threading.Condition.wait,
    ) -> None:
        self._rate, self._paused, self._steady, self._wait = rate, paused, steady, wait
        self._changed = threading.Condition()
        self._bag_anchor, self._steady_anchor = 0, steady()

    @property
    def paused(self) -> bool:
        """True if the time stands still."""
        return self._paused

    def jump(self, bag_time: int) -> None:
        """Go on from another time."""
        with self._changed:
            self._bag_anchor, self._steady_anchor = bag_time, self._steady()
            self._changed.notify_all()

    def now(self) -> int:
        """Return the time in the bag."""
        with self._changed:
            elapsed = 0 if self._paused else self._steady() - self._steady_anchor
            return self._bag_anchor + round(elapsed * self._rate)

    def set_paused(self, paused: bool) -> None:
        """Stop or go on; whoever waits hears of it."""
        with self._changed:
            self.jump(self.now())
            self._paused = paused

    def wait_until(self, bag_time: int, at_most: float | None = None) -> bool:
        """Wait for a time in the bag, at most some seconds, or until something changes; tell whether it is there."""
        with self._changed:
            left = bag_time - self.now()
            if left > 0:
                timeout = None if self._paused else left / self._rate / SECOND
                if at_most is not None:
                    timeout = at_most if timeout is None else min(at_most, timeout)
                self._wait(self._changed, timeout)
            return not self._paused and self.now() >= bag_time
