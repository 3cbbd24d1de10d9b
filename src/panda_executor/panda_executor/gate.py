"""The gate for requests: one at a time, and a stop that holds until it is released."""

from __future__ import annotations

import threading
from collections.abc import Callable

from cliport_core import topics


class Gate:
    """Admits one request at a time; has a latching stop and a final end. Safe between threads.

    A stop ends the request that runs for good: `release` lets the next one in, and does not revive that one.

    Args:
        at_rest: whether the arm is measured at rest; asked before the first request after a motion.
    """

    def __init__(self, at_rest: Callable[[], bool] = lambda: True) -> None:
        self._lock = threading.Lock()
        self._at_rest = at_rest
        self._busy = False
        self._moving = False
        self._latched = ""
        self._stops = 0  # how many there were; a request that entered before the last one has to end
        self._stops_at_entry = 0
        self._closed = False

    def refusal(self) -> str | None:
        """Return why no request can start now, in one line, or None."""
        with self._lock:
            return self._refusal()

    def _refusal(self) -> str | None:
        if self._closed:
            return "the executor is shutting down"
        if self._latched:
            return f"{self._latched}; call {topics.EXECUTOR_RESUME} first"
        if self._busy:
            return "another goal is being executed"
        if self._moving and not self._at_rest():
            return (
                "the arm was not seen to stand still since its last motion; are its joint states coming in, and do "
                "they change when it is moved by hand?"
            )
        self._moving = False
        return None

    def enter(self) -> str | None:
        """Begin a request; return None when it may run, otherwise why not."""
        with self._lock:
            refusal = self._refusal()
            if refusal is None:
                self._busy, self._stops_at_entry = True, self._stops
            return refusal

    def note_motion(self) -> None:
        """Note that the arm is told to move: the next request waits for a measured standstill."""
        with self._lock:
            self._moving = True

    def leave(self) -> None:
        """Note that the request is over."""
        with self._lock:
            self._busy = False
            self._moving = self._moving and not self._at_rest()

    def latch(self, why: str) -> None:
        """Stop what runs and let nothing start until `release`."""
        with self._lock:
            self._latched = why
            self._stops += 1

    def release(self) -> None:
        """End a stop."""
        with self._lock:
            self._latched = ""

    def close(self) -> None:
        """Stop what runs and let nothing start ever again."""
        with self._lock:
            self._closed = True

    @property
    def busy(self) -> bool:
        """True while a request runs."""
        with self._lock:
            return self._busy

    @property
    def stopped(self) -> bool:
        """True if a running request has to end."""
        with self._lock:
            stopped_since = self._busy and self._stops != self._stops_at_entry
            return self._closed or bool(self._latched) or stopped_since
