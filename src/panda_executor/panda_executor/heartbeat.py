"""A sign of life to the arm's side, many times a second, from the process that commands it."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Heartbeat:
    """Calls `beat` every `period` s from a thread of its own: planning in another thread does not hold it up.

    The arm's side stops the arm when the beats end during a motion: a process that was killed cannot cancel.
    """

    def __init__(self, beat: Callable[[], None], period: float = 0.05) -> None:
        self._beat, self._period = beat, period
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.wait(self._period):
            self._beat()

    def stop(self) -> None:
        """End the thread; returns when no beat is under way."""
        self._end.set()
        self._thread.join(timeout=1.0)
