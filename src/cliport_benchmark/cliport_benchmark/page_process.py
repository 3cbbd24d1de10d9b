"""The demonstration page's server, `ros2 run demo_tool app`, as a process."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
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
        self._process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE)
        assert self._process.stdout is not None
        said, found = "", None
        deadline = time.monotonic() + _START_TIMEOUT_S
        while found is None:  # Fast DDS may complain first, of a port that another process has taken
            spoke, _, _ = select.select([self._process.stdout], [], [], max(0.0, deadline - time.monotonic()))
            more = os.read(self._process.stdout.fileno(), 4096).decode(errors="replace") if spoke else ""
            if not more:
                self.end()
                why = (said.strip() or "see above") if spoke else f"it gave no address in {_START_TIMEOUT_S:.0f} s"
                raise BenchmarkError(f"the page did not start: {why}")
            said += more
            found = re.search(r"(http://\S+:(\d+))/", said)
        self.address, self.port = found[1], int(found[2])

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
