"""Worker thread for long work, one job after the other."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue

Job = Callable[[], None]


class WorkThread:
    """Thread that calls jobs in order; a job handles its own errors."""

    def __init__(self) -> None:
        self._jobs: SimpleQueue[Job] = SimpleQueue()
        threading.Thread(target=self._run, name="station work", daemon=True).start()

    def __call__(self, job: Job) -> None:
        """Take a job; returns at once."""
        self._jobs.put(job)

    def _run(self) -> None:
        while True:
            self._jobs.get()()
