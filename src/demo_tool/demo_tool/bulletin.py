"""What was said last, and a counter by which watchers see that something changed."""

from __future__ import annotations

import threading


class Bulletin:
    """Safe between threads; `lock` also guards whatever its holder shows beside it."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._condition = threading.Condition(self.lock)
        self._changed = 0
        self.last: dict[str, object] = {"ok": True, "words": ""}
        self.failure = ""

    @property
    def changed(self) -> int:
        """Counts up with every change."""
        return self._changed

    def touch(self) -> None:
        """Something changed."""
        with self.lock:
            self._changed += 1
            self._condition.notify_all()

    def say(self, words: str) -> None:
        """Something went well."""
        self._set(True, words, "")

    def refuse(self, words: str) -> None:
        """A command was not obeyed; all is as before."""
        self._set(False, words, self.failure)

    def fail(self, words: str) -> None:
        """Something that had begun did not end well."""
        self._set(False, words, words)

    def forgive(self) -> None:
        """The failure is history: something new begins."""
        with self.lock:
            self.failure = ""

    def wait(self, after: int, timeout: float) -> int:
        """The counter, once it is not `after` any more, or after `timeout` seconds."""
        with self.lock:
            self._condition.wait_for(lambda: self._changed != after, timeout)
            return self._changed

    def _set(self, ok: bool, words: str, failure: str) -> None:
        with self.lock:
            self.last = {"ok": ok, "words": words}
            self.failure = failure
            self.touch()
