"""The latest message to the person, and a counter of changes."""

from __future__ import annotations

import threading


class Bulletin:
    """Latest message and counter of changes; safe between threads. `lock` also guards what its users show."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._condition = threading.Condition(self.lock)
        self._changed = 0
        self.last: dict[str, object] = {"ok": True, "words": ""}
        self.failure = ""

    @property
    def changed(self) -> int:
        """Number of changes so far."""
        return self._changed

    def touch(self) -> None:
        """Count a change and wake those who wait."""
        with self.lock:
            self._changed += 1
            self._condition.notify_all()

    def say(self, words: str) -> None:
        """Announce a success."""
        self._set(True, words, "")

    def refuse(self, words: str) -> None:
        """Announce that a command was refused, with no effect."""
        self._set(False, words, self.failure)

    def fail(self, words: str) -> None:
        """Announce the failure of something that had begun."""
        self._set(False, words, words)

    def clear_failure(self) -> None:
        """Forget the last failure, as something new begins."""
        with self.lock:
            self.failure = ""

    def wait(self, after: int, timeout: float) -> int:
        """Wait until the counter differs from `after`, at most `timeout` seconds; return it."""
        with self.lock:
            self._condition.wait_for(lambda: self._changed != after, timeout)
            return self._changed

    def _set(self, ok: bool, words: str, failure: str) -> None:
        with self.lock:
            self.last = {"ok": ok, "words": words}
            self.failure = failure
            self.touch()
