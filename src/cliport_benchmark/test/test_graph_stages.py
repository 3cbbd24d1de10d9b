"""How a graph's processes are started, watched and stopped, stage by stage."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import graph_process
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_process import GraphProcess

INT, TERM, KILL = signal.SIGINT, signal.SIGTERM, signal.SIGKILL
TELLING = (
    '#!/bin/sh\necho "$@"\necho "$ROS_AUTOMATIC_DISCOVERY_RANGE $ROS_DOMAIN_ID"\necho ready >&2\nexec /bin/sleep 600\n'
)


def test_a_launch_file_is_started_with_its_arguments_and_variables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ros2 = tmp_path / "ros2"
    ros2.write_text(TELLING)
    ros2.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    graph = GraphProcess(
        "sim.launch.yaml", {"task": "t", "seed": "0"}, tmp_path / "new" / "log", {"ROS_DOMAIN_ID": "9"}
    )
    assert (graph.alive, graph.healthy, graph.pids(), graph.log_text()) == (False, False, [], "")
    graph.stop()
    with graph:
        while graph.alive and not any(graph_process._command_line(pid)[0] == "/bin/sleep" for pid in graph.pids()):
            time.sleep(0.02)
        assert graph.log_text() == "launch cliport_bringup sim.launch.yaml task:=t seed:=0\nLOCALHOST 9\nready\n"
        assert graph.alive and graph.healthy and graph.pids() == [graph.pid_of("sleep")]
        with pytest.raises(BenchmarkError, match=r"^no process of the graph runs policy$"):
            graph.pid_of("policy")
        with graph.log_path.open("a") as log:
            log.write("".join(f"line {n}\n" for n in range(20)) + "[ERROR] process has died\n")
        assert graph.alive and not graph.healthy
        assert graph.log_tail(2) == "line 19\n[ERROR] process has died"
        assert graph.log_tail().splitlines()[0] == "line 6" and len(graph.log_tail().splitlines()) == 15
    assert not graph.alive and not graph.healthy and graph.pids() == []


def test_without_ros2_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BenchmarkError, match=r"^no `ros2` command on the PATH: run `source env.sh` first$"):
        GraphProcess("sim.launch.yaml", {}, tmp_path / "log").__enter__()


@pytest.mark.parametrize(
    ("ends_at", "signals", "waited"),
    [
        (INT, [(7, INT)], 0),
        (TERM, [(7, INT), (7, TERM), (8, TERM)], 12),
        (KILL, [(7, INT), (7, TERM), (8, TERM), (7, KILL), (8, KILL)], 17),
        (None, [(7, INT), (7, TERM), (8, TERM), (7, KILL), (8, KILL)], 22),
    ],
)
def test_a_graph_is_interrupted_then_terminated_then_killed(
    monkeypatch: pytest.MonkeyPatch, ends_at: signal.Signals | None, signals: list[Any], waited: int
) -> None:
    told: list[tuple[int, signal.Signals]] = []
    clock = [0.0]

    def sleep(seconds: float) -> None:
        clock[0] += seconds

    def ended() -> bool:
        return any(number is ends_at for _, number in told)

    graph = GraphProcess("sim.launch.yaml", {}, Path("log"))
    graph._process = SimpleNamespace(pid=7, poll=lambda: 0 if ended() else None)  # type: ignore[assignment]
    monkeypatch.setattr(graph, "pids", lambda: [] if ended() else [7, 8])
    monkeypatch.setattr(graph_process, "time", SimpleNamespace(monotonic=lambda: clock[0], sleep=sleep))
    monkeypatch.setattr(graph_process, "_signal", lambda pid, number: told.append((pid, number)))
    graph.stop()
    assert told == signals and clock[0] == pytest.approx(waited, abs=0.2)


def test_a_process_that_is_gone_has_no_session_no_state_and_no_command() -> None:
    gone = 2**22 + 1  # above the highest number that Linux gives
    graph_process._signal(gone, INT)
    assert graph_process._session_of(gone) == -1 and graph_process._state(gone) == "Z"
    assert graph_process._command_line(gone) == []
    own = os.getpid()
    assert graph_process._session_of(own) == os.getsid(own) and own in graph_process._all_pids()
