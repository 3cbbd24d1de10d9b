"""A graph's processes, played by a script in the place of `ros2`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

ROS2 = "#!/bin/sh\necho started\nexec sleep 600\n"
USER = """
import sys, time
from pathlib import Path
from cliport_benchmark.graph_process import GraphProcess
with GraphProcess("any.launch.yaml", {}, Path(sys.argv[1])) as graph:
    print(*graph.pids(), flush=True)
    while True:  # a signal that comes just before a sleep is heard after it
        time.sleep(0.05)
"""


def test_nothing_of_the_graph_outlives_a_program_that_is_terminated(tmp_path: Path) -> None:
    ros2 = tmp_path / "ros2"
    ros2.write_text(ROS2)
    ros2.chmod(0o755)
    program = subprocess.Popen(
        [sys.executable, "-c", USER, str(tmp_path / "log")],
        env={**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert program.stdout is not None
    (pid,) = map(int, program.stdout.readline().split())
    program.send_signal(signal.SIGTERM)
    assert program.wait(60.0) != 0
    program.stdout.close()
    assert not Path(f"/proc/{pid}").exists()
