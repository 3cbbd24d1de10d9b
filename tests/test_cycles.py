"""Many cycles of pick and place through the graph, as fast as it goes: nothing crashes, grows, slows or is left behind.

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
from process_memory import memory_mb, processor_seconds
from ros_domain import next_domain
from shared_memory import is_used, shared_files
from sim_settings import shipped_settings, written

from cliport_benchmark.graph_process import GraphProcess

CYCLES = int(os.environ.get("CYCLES", "1000"))  # of pick and place, at least: the last round is played to its end
ROUND = max(CYCLES * 75 // 1000, 1)  # scenes, of 1.6 cycles on average; they come again in each round
TASK = "put-blocks-in-bowls-seen-colors"
FASTER = "20"  # than real time: as fast as the machine draws the camera's pictures, for which time waits
CAMERA_RATE = 2.5  # Hz of simulated time: half of what is shipped, so that there is half as much to draw
DONE = 0.9  # of the scenes, at least: the shipped policy ends nearly all of this task's
GROWTH_MB = 20.0  # of a process after the first round, at most
SLOWER = 1.05  # the last round than the first, at most, where the machine itself is as fast as it was
ENOUGH = 10  # scenes of a round from which on its memory and pace say anything
OUT = ROOT / "out" / "cycles.json"

pytestmark = [pytest.mark.soak, pytest.mark.timeout(12 * 3600)]


def test_a_thousand_cycles_leave_the_graph_as_it_was(tmp_path: Path) -> None:
    """The scenes of the first round come again in each other, so that their paces can be compared."""
    domain, before = next_domain(), shared_files()
    settings = shipped_settings()
    settings["/sim_bridge"]["ros__parameters"]["camera_rate"] = CAMERA_RATE
    params = str(written(settings, tmp_path))
    arguments = {"task": TASK, "split": "test", "seed": "0", "real_time_factor": FASTER, "params": params}
    seconds: list[float] = []  # of each scene
    machine: list[float] = []  # processor time of one and the same work after each scene [s]
    memory: list[dict[str, float]] = []  # of each process, the median of a round [MB]
    work: list[float] = []  # processor time of all processes for a cycle, of each round [s]
    cycles = done = 0
    with (
        GraphProcess("sim.launch.yaml", arguments, tmp_path / "graph.log", {"ROS_DOMAIN_ID": str(domain)}) as graph,
        GraphProbe(domain) as probe,
    ):
        probe.wait_ready(120.0, lambda: graph.alive)
        while cycles < CYCLES:
            before_round = cycles, sum(map(processor_seconds, graph.pids()))
            held: dict[str, list[float]] = defaultdict(list)  # after each scene of the round [MB]
            for seed in range(ROUND):
                began = time.monotonic()
                sentence = probe.reset(TASK, "test", seed)
                ended = probe.instruct_and_wait(sentence, 300.0, lambda: graph.healthy)
                seconds.append(time.monotonic() - began)
                cycles, done = cycles + ended.steps, done + ended.succeeded
                machine.append(own_seconds())
                assert graph.healthy, graph.log_tail(40)
                for pid in graph.pids():
                    held[name_of(pid)].append(memory_mb("VmRSS", pid))
            memory.append({name: median(values) for name, values in held.items()})
            took = sum(map(processor_seconds, graph.pids())) - before_round[1]
            work.append(took / max(cycles - before_round[0], 1))
            found = {"cycles": cycles, "scenes": len(seconds), "succeeded": done, "processor_s_a_cycle": work}
            write({**found, "memory_mb": memory}, seconds)
            assert done >= DONE * len(seconds), f"{done} of {len(seconds)} scenes succeeded"
        assert "Traceback" not in graph.log_text(), graph.log_tail(60)
    growth = {name: memory[-1][name] - at_first for name, at_first in memory[0].items()}
    slower, machine_slower = (median(times[-ROUND:]) / median(times[:ROUND]) for times in (seconds, machine))
    left = sorted(name for name in shared_files() - before if not is_used(name))
    found |= {
        "growth_mb": growth,
        "left": left,
        "last_to_first_round": slower,
        "machine_last_to_first_round": machine_slower,
    }
    write({**found, "memory_mb": memory}, seconds)
    print(found)
    assert not left
    if ROUND >= ENOUGH:
        assert max(growth.values()) <= GROWTH_MB, growth
        assert max(slower, work[-1] / work[0]) <= SLOWER * machine_slower, (slower, work)


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
