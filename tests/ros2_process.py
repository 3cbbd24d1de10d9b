"""Helpers for the tests of `ros2`: the command run to its end, and processes that are read while they run."""

from __future__ import annotations

import queue
import re
import shutil
import signal
import subprocess
import threading
from pathlib import Path

ROS2 = shutil.which("ros2") or str(Path(__file__).parents[1] / "tools/ros2/bin/ros2")
TIMEOUT = 60.0  # s, for what takes 1 or 2 where nothing else runs


def ros2(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run(
        [ROS2, *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        stdin=subprocess.DEVNULL,
    )


def ros2_each(environment: dict[str, str], *commands: list[str]) -> list[subprocess.CompletedProcess[str]]:
    """Run commands one after the other: side by side they take each other's ends for answers of the graph."""
    return [ros2(environment, *command) for command in commands]


class Background:
    """A process that is read while it runs: one that nobody reads stops when the pipe is full."""

    def __init__(self, environment: dict[str, str], *command: str) -> None:
        self.process = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.output = ""

    def read_until(self, pattern: str) -> str:
        """Return the next line that matches; a process that ends or says nothing more fails the test."""
        while (line := self._lines.get(timeout=TIMEOUT)) is not None:
            self.output += line
            if re.search(pattern, line):
                return line
        self._lines.put(None)
        raise AssertionError(f"ended without {pattern!r}:\n{self.output}")

    def end(self, number: int = signal.SIGINT) -> int:
        """Signal it, read the rest of its output and return its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            status = self.process.wait(timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self._reader.join(TIMEOUT)
        while not self._lines.empty():
            self.output += self._lines.get() or ""
        return status

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(None)
