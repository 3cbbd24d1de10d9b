"""Long work, one piece after the other, in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import SimpleQueue

Job = Callable[[], None]


class WorkThread:
    """Calls what it is given, in order. A job sees to its own errors."""

    def __init__(self) -> None:
        self._jobs: SimpleQueue[Job] = SimpleQueue()
        threading.Thread(target=self._run, name="station work", daemon=True).start()

    def __call__(self, job: Job) -> None:
        """Take a job; returns at once."""
        self._jobs.put(job)

    def _run(self) -> None:
        while True:
            self._jobs.get()()
