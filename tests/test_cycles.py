"""Many cycles through the graph, faster than real time: most succeed, nothing crashes, grows, slows or is left behind.

`make soak PYTEST_ARGS=tests/test_cycles.py` runs this, with CYCLES=10 before it fewer.
"""

from __future__ import annotations

import json
import os
import time
from collections import defaultdict
from pathlib import Path
from statistics import median

import numpy as np
import pytest
from graph_probe import GraphProbe
from hardware_times import ROOT
from process_memory import memory_mb
from ros_domain import next_domain
from shared_memory import is_used, shared_files

from cliport_benchmark.graph_process import GraphProcess

CYCLES = int(os.environ.get("CYCLES", "1000"))
TENTH = max(CYCLES // 10, 1)
TASK = "put-blocks-in-bowls-seen-colors"
FASTER = "20"  # than real time: as fast as the machine draws the camera's pictures, for which time waits
DONE = 0.9  # of the cycles, at least: the shipped policy ends nearly all of this task's
GROWTH_MB = 20.0  # of a process after the first tenth, at most
SLOWER = 1.05  # the last tenth than the first, at most, where the machine itself is as fast as it was
ENOUGH = 100  # cycles from which on the pace says anything
OUT = ROOT / "out" / "cycles.json"

pytestmark = [pytest.mark.soak, pytest.mark.timeout(12 * 3600)]


def test_a_thousand_cycles_leave_the_graph_as_it_was(tmp_path: Path) -> None:
    """The scenes of the first tenth come again in each other, so that their paces can be compared."""
    domain, before = next_domain(), shared_files()
    arguments = {"task": TASK, "split": "test", "seed": "0", "real_time_factor": FASTER}
    seconds: list[float] = []
    machine: list[float] = []  # processor time of one and the same work after each cycle [s]
    memory: list[dict[str, float]] = []  # of each process, the median after a tenth's cycles [MB]
    held: dict[str, list[float]] = defaultdict(list)  # after each cycle of the tenth under way [MB]
    done = 0
    with (
        GraphProcess("sim.launch.yaml", arguments, tmp_path / "graph.log", {"ROS_DOMAIN_ID": str(domain)}) as graph,
        GraphProbe(domain) as probe,
    ):
        probe.wait_ready(120.0, lambda: graph.alive)
        for cycle in range(CYCLES):
            began = time.monotonic()
            sentence = probe.reset(TASK, "test", cycle % TENTH)
            done += probe.instruct_and_wait(sentence, 300.0, lambda: graph.healthy).succeeded
            seconds.append(time.monotonic() - began)
            machine.append(own_seconds())
            assert graph.healthy, graph.log_tail(40)
            for pid in graph.pids():
                held[name_of(pid)].append(memory_mb("VmRSS", pid))
            if (cycle + 1) % TENTH == 0:
                memory.append({name: median(values) for name, values in held.items()})
                held.clear()
                write({"cycles": cycle + 1, "succeeded": done, "memory_mb": memory}, seconds)
        assert "Traceback" not in graph.log_text(), graph.log_tail(60)
    growth = {name: memory[-1][name] - at_first for name, at_first in memory[0].items()}
    slower, machine_slower = (median(times[-TENTH:]) / median(times[:TENTH]) for times in (seconds, machine))
    left = sorted(name for name in shared_files() - before if not is_used(name))
    found = {"cycles": CYCLES, "succeeded": done, "growth_mb": growth, "left": left}
    found |= {"last_to_first_tenth": slower, "machine_last_to_first_tenth": machine_slower}
    write({**found, "memory_mb": memory}, seconds)
    print(found)
    assert done >= DONE * CYCLES, f"{done} of {CYCLES} succeeded"
    assert not left
    assert max(growth.values()) <= GROWTH_MB, growth
    assert CYCLES < ENOUGH or slower <= SLOWER * machine_slower


def own_seconds() -> float:
    """Return the processor time of a fixed computation [s]: machines are not as fast at each hour."""
    began = time.process_time()
    for _ in range(20):
        np.sort(np.random.default_rng(0).random(100_000))
    return time.process_time() - began


def write(found: dict[str, object], seconds: list[float]) -> None:
    """Write what is known so far: a run takes hours, and may be cut off."""
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps({**found, "seconds": [round(value, 2) for value in seconds]}, indent=1) + "\n")


def name_of(pid: int) -> str:
    arguments = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    return f"{' '.join(Path(argument).name for argument in arguments[:2])} {pid}"
