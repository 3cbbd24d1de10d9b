"""The whole graph as real processes: started by `ros2 launch`, stopped so that nothing is left behind."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.termination import termination_interrupts

STOP_STAGES = ((signal.SIGINT, 12.0), (signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0))


class GraphProcess:
    """One launch file, running in a process group of its own. Use as a context manager.

    arguments: launch arguments by name. log_path: where the output of every node goes.
    environment: variables set on top of this process's own (ROS_DOMAIN_ID, say).
    """

    def __init__(
        self,
        launch_file: str,
        arguments: Mapping[str, str],
        log_path: Path,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.log_path = log_path
        self._command = [
            "launch",
            "cliport_bringup",
            launch_file,
            *(f"{k}:={v}" for k, v in arguments.items()),
        ]
        self._environment = {
            **os.environ,
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            **(environment or {}),
        }
        self._process: subprocess.Popen[bytes] | None = None
        self._termination = ExitStack()

    def __enter__(self) -> GraphProcess:
        ros2 = shutil.which("ros2", path=self._environment.get("PATH"))
        if ros2 is None:
            raise BenchmarkError("no `ros2` command on the PATH: run `source env.sh` first")
        self.log_path.parent.mkdir(parents=True, exist_ok=True)
        with self.log_path.open("wb") as log:
            self._process = subprocess.Popen(
                [ros2, *self._command],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._environment,
                start_new_session=True,
            )
        self._termination.enter_context(termination_interrupts())
        return self

    def __exit__(self, *_: object) -> None:
        with self._termination:
            self.stop()

    @property
    def alive(self) -> bool:
        """True if the launch process still runs."""
        return self._process is not None and self._process.poll() is None

    @property
    def healthy(self) -> bool:
        """True if the launch process runs and none of its nodes has died."""
        return self.alive and "process has died" not in self.log_text()

    def log_text(self) -> str:
        """Return everything that the nodes have printed so far."""
        return self.log_path.read_text(errors="replace") if self.log_path.is_file() else ""

    def log_tail(self, lines: int = 15) -> str:
        """Return the last lines that the nodes printed."""
        return "\n".join(self.log_text().splitlines()[-lines:])

    def pids(self) -> list[int]:
        """Return the processes of the graph that are alive, by their session."""
        if self._process is None:
            return []
        return [pid for pid in _all_pids() if _session_of(pid) == self._process.pid]

    def pid_of(self, executable: str) -> int:
        """Find the process that runs .../lib/<package>/<executable>. Raises BenchmarkError where there is none."""
        for pid in self.pids():
            arguments = _command_line(pid)
            if any(argument.endswith(f"/{executable}") for argument in arguments[:3]):
                return pid
        raise BenchmarkError(f"no process of the graph runs {executable}")

    def stop(self) -> None:
        """Interrupt, then terminate, then kill every process of the graph; returns when none is left."""
        if self._process is None:
            return
        for number, patience in STOP_STAGES:
            if number is signal.SIGINT:
                _signal(self._process.pid, number)
            else:
                for pid in self.pids():
                    _signal(pid, number)
            deadline = time.monotonic() + patience
            while time.monotonic() < deadline:
                if self._process.poll() is not None and not self.pids():
                    return
                time.sleep(0.05)


def _signal(pid: int, number: signal.Signals) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def _all_pids() -> list[int]:
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]


def _session_of(pid: int) -> int:
    try:
        return os.getsid(pid) if _state(pid) != "Z" else -1
    except (ProcessLookupError, PermissionError):
        return -1


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return "Z"


def _command_line(pid: int) -> list[str]:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []
