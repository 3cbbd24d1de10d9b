"""A bag that `ros2 bag record` makes beside a program, until it is ended."""

from __future__ import annotations

import shutil
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

_ENDS = 10.0  # a recorder gets to close its bag [s]


class RunBag:
    """Recorder of topics to a new folder, in a process group of its own: Ctrl-C reaches it through `end` only.

    ends: how long it gets to close the bag [s].
    """

    def __init__(self, path: Path, topics: Sequence[str], ends: float = _ENDS) -> None:
        self._ends = ends
        ros2 = shutil.which("ros2")
        command = [str(ros2), "bag", "record", "-o", str(path), "--topics", *topics]
        self._process = None if ros2 is None else subprocess.Popen(command, start_new_session=True)

    def end(self) -> str:
        """End the recording; return what became of it, as a phrase."""
        if self._process is None:
            return "no bag, because there is no ros2 command here"
        self._process.send_signal(signal.SIGINT)
        try:
            status = self._process.wait(self._ends)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            return f"a bag that was not closed within {self._ends:g} s and may be torn"
        return "a bag" if status == 0 else f"no whole bag: its recorder ended with status {status}"
