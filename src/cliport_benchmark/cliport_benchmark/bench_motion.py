"""Time from an instruction to the arm's first motion, in the running graph."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_process import GraphProcess

_READY_S = 300.0  # wait for the graph at most; one core of a slow machine has four processes to start
_PATIENCE_S = 60.0  # wait at most for the arm to move, and for it to rest again


def first_motions(task: str, n: int) -> tuple[list[float], list[str]]:
    """Measure n scenes; a scene that gives no time does not cost those of the others.

    Returns:
        Seconds from publishing an instruction to the first motion of a joint, and why scenes gave none.

    Raises:
        BenchmarkError: when the graph does not come up.
    """
    with tempfile.TemporaryDirectory() as folder:
        arguments = {"task": task, "split": "val", "seed": "0"}
        with (
            GraphProcess("sim.launch.yaml", arguments, Path(folder) / "log") as graph,
            GraphClient("bench") as client,
        ):
            client.wait_ready(_READY_S, lambda: graph.healthy)
            return _measured(graph, client, task, n)


def _measured(graph: GraphProcess, client: GraphClient, task: str, n: int) -> tuple[list[float], list[str]]:
    samples: list[float] = []
    failures: list[str] = []
    for seed in range(n):
        try:
            sentence = client.reset(task, "val", seed)
            time.sleep(1.0)
            samples.append(client.seconds_to_motion(sentence, _PATIENCE_S))
            client.instruct("")
            client.wait_at_rest(_PATIENCE_S)
        except BenchmarkError as error:
            failures.append(f"scene {seed}: {error}")
            if not graph.healthy:
                break
            client.instruct("")
    return samples, failures
