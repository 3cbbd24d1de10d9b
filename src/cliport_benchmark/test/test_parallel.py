"""Parallel work: results come as they are ready, and no process outlives the one that started it."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.parallel import run_parallel

SCRIPT = """
import os, sys, time
from cliport_benchmark.parallel import run_parallel

def nothing():
    pass

def work(seconds):
    time.sleep(seconds)
    return os.getpid()

if __name__ == "__main__":
    for item, pid in run_parallel(work, [0.0, float(sys.argv[1])], 1, nothing):
        print(item, pid, flush=True)
"""


def start(folder: Path, seconds: float) -> subprocess.Popen[str]:
    path = folder / "work.py"
    path.write_text(SCRIPT)
    return subprocess.Popen([sys.executable, str(path), str(seconds)], stdout=subprocess.PIPE, text=True)


def test_everything_is_done(tmp_path: Path) -> None:
    process = start(tmp_path, 0.1)
    out, _ = process.communicate(timeout=30)
    assert [line.split()[0] for line in out.splitlines()] == ["0.0", "0.1"] and process.returncode == 0


def half(number: int) -> int:
    if number == 3:
        raise ValueError("3 is odd")
    return number // 2


def nothing() -> None:
    """Needs no preparation."""


def test_what_finished_is_kept_when_one_item_raises() -> None:
    results = run_parallel(half, [3, 2, 4, 6], 1, nothing)
    assert sorted(next(results) for _ in range(3)) == [(2, 1), (4, 2), (6, 3)]
    with pytest.raises(BenchmarkError, match=r"^3: ValueError: 3 is odd$"):
        next(results)


def test_a_killed_parent_leaves_no_process(tmp_path: Path) -> None:
    process = start(tmp_path, 60.0)
    assert process.stdout is not None
    child = int(process.stdout.readline().split()[1])
    process.send_signal(signal.SIGKILL)
    process.wait()
    for _ in range(100):
        if not alive(child):
            return
        time.sleep(0.1)
    os.kill(child, signal.SIGKILL)
    raise AssertionError(f"process {child} was left behind")


def alive(pid: int) -> bool:
    """Return True if a process runs: one that ended and that nobody waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
