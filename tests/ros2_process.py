"""Helpers for the tests of `ros2`: the command run to its end, and processes that are read while they run."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
from pathlib import Path

ROS2 = shutil.which("ros2") or str(Path(__file__).parents[1] / "tools/ros2/bin/ros2")
TIMEOUT = 60.0  # s, for what takes 1 or 2 where nothing else runs


def ros2(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command, once more where it hangs: Fast DDS now and then sends a subscriber nothing that takes the port of
    one which has just ended."""

    def run(timeout: float) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [ROS2, *arguments],
            env=environment,
            capture_output=True,
            text=True,
            timeout=timeout,
            stdin=subprocess.DEVNULL,
        )

    try:
        return run(TIMEOUT / 3)
    except subprocess.TimeoutExpired:
        return run(TIMEOUT)


class Background:
    """A process that is read while it runs."""

    def __init__(self, environment: dict[str, str], *command: str) -> None:
        self.process = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        self.output = ""

    def read_until(self, pattern: str) -> str:
        """Read on until a line matches; a process that says nothing more fails the test by its time-out."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.output += line
            if re.search(pattern, line):
                return line
        raise AssertionError(f"ended without {pattern!r}:\n{self.output}")

    def end(self, number: int = signal.SIGINT) -> int:
        """Signal it, read the rest of its output and return its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            rest, _ = self.process.communicate(timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self.output += rest
        return self.process.returncode
