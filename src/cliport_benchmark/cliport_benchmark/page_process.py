"""The demonstration page's server, `ros2 run demo_tool app`, as a process."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.process_time import cpu_seconds

_START_TIMEOUT_S = 180.0  # wait for its address at most; it may share one core with a graph that starts
_END_TIMEOUT_S = 20.0  # wait for its end at most


class PageProcess:
    """Runs from its making until `end`, or to the end of the context that it is used as. port 0: a free one.

    address: of the page, as a browser takes it.

    Raises:
        BenchmarkError: when it does not start.
    """

    def __init__(self, data_sets: Path, domain_id: int | None = None, port: int = 0) -> None:
        environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        if domain_id is not None:
            environment["ROS_DOMAIN_ID"] = str(domain_id)
        command = [sys.executable, "-m", "demo_tool.app", "--port", str(port), "--data-sets", str(data_sets)]
        self._process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        spoke, _, _ = select.select([self._process.stdout], [], [], _START_TIMEOUT_S)
        line = self._process.stdout.readline() if spoke else f"it said nothing in {_START_TIMEOUT_S:.0f} s"
        found = re.search(r"http://\S+:(\d+)", line)
        if not found:
            self.end()
            raise BenchmarkError(f"the page did not start: {line.strip() or 'see above'}")
        self.address, self.port = found[0], int(found[1])

    def __enter__(self) -> PageProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal, if it still runs, and wait; the exit status."""
        if self._process.poll() is None:
            self._process.send_signal(number)
        try:
            return self._process.wait(_END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def cpu_seconds(self) -> float:
        """Return the time that it has used so far, of all cores [s]."""
        return cpu_seconds(self._process.pid)

    @property
    def pid(self) -> int:
        """The process."""
        return self._process.pid

    def resident_mb(self) -> float:
        """Return the memory that it holds [MB]."""
        status = Path(f"/proc/{self._process.pid}/status").read_text()
        return next(int(line.split()[1]) / 1024 for line in status.splitlines() if line.startswith("VmRSS"))
