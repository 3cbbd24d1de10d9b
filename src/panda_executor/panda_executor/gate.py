"""The gate for requests: one at a time, and a stop that holds until it is released."""

from __future__ import annotations

import threading

from cliport_core import topics


class Gate:
    """Admits one request at a time; has a latching stop and a final end. Safe between threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._busy = False
        self._latched = ""
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
        return None

    def enter(self) -> str | None:
        """Begin a request; return None when it may run, otherwise why not."""
        with self._lock:
            refusal = self._refusal()
            self._busy = self._busy or refusal is None
            return refusal

    def leave(self) -> None:
        """Note that the request is over."""
        with self._lock:
            self._busy = False

    def latch(self, why: str) -> None:
        """Stop what runs and let nothing start until `release`."""
        with self._lock:
            self._latched = why

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
            return self._closed or bool(self._latched)
