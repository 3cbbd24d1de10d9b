"""Who may start a request, and what makes a running one stop."""

from __future__ import annotations

import threading


class Gate:
    """One request at a time; a latching stop; an end. Safe between threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._busy = False
        self._latched = ""
        self._closed = False

    def refusal(self) -> str | None:
        """Why no request can start now, in one line, or None."""
        with self._lock:
            return self._refusal()

    def _refusal(self) -> str | None:
        if self._closed:
            return "the executor is shutting down"
        if self._latched:
            return f"{self._latched}; call /panda_executor/resume first"
        if self._busy:
            return "another goal is being executed"
        return None

    def enter(self) -> str | None:
        """Begin a request: None when it may run, otherwise why not."""
        with self._lock:
            refusal = self._refusal()
            self._busy = self._busy or refusal is None
            return refusal

    def leave(self) -> None:
        """The request is over."""
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
        """Whether a request runs."""
        with self._lock:
            return self._busy

    @property
    def stopped(self) -> bool:
        """Whether a running request has to end."""
        with self._lock:
            return self._closed or bool(self._latched)
