"""Signs of life, many times a second, from a process that commands or owns a motion."""

from __future__ import annotations

import threading
from collections.abc import Callable


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
