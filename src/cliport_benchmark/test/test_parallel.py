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
from cliport_benchmark.with_parent import command_with_parent

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


PREPARED = """
import os
with open(os.environ["IMPORTED"], "a") as file:
    file.write(f"{os.getpid()}\\n")

def work(share, number):
    return os.getpid()
"""
TWICE = """
import os
from functools import partial
import prepared
from cliport_benchmark.parallel import run_parallel

def nothing():
    pass

if __name__ == "__main__":
    for _ in range(2):
        for _, pid in run_parallel(partial(prepared.work, 1.0), [1, 2, 3], 2, nothing):
            assert pid != os.getpid()
"""
LATER = """
import os
from cliport_benchmark.parallel import run_parallel

def nothing():
    pass

def work(number):
    import prepared
    return prepared.work(1.0, number)

if __name__ == "__main__":
    workers = {pid for _, pid in run_parallel(work, [1, 2, 3], 2, nothing, preload=("prepared",))}
    with open(os.environ["IMPORTED"]) as file:
        assert workers and not workers & {int(line) for line in file}
"""


COMMANDS = """
import signal, subprocess, sys
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.with_parent import command_with_parent

def nothing():
    pass

def work(item):
    subprocess.run(command_with_parent("sleeper", ["a word"]))

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it from the start
    list(run_parallel(work, [1, 2], 2, nothing))
"""
SLEEPER = """
import os, sys, time
assert sys.argv[1:] == ["a word"] and __name__ == "__main__"
os.write(1, f"{os.getpid()}\\n".encode())  # as a whole: two of them write to one pipe
time.sleep(60)
"""


def test_a_command_ends_as_its_module_does() -> None:
    assert subprocess.run(command_with_parent("colorsys", []), check=False, timeout=120).returncode == 0
    assert subprocess.run(command_with_parent("json.tool", ["/nowhere"]), check=False, timeout=120).returncode != 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_commands_that_the_work_starts_end_with_it(tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "commands.py").write_text(COMMANDS)
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, str(tmp_path / "commands.py")]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment, start_new_session=True
    )
    assert process.stdout is not None
    started = [int(process.stdout.readline()) for _ in range(2)]
    process.send_signal(number)
    process.wait(timeout=120)
    assert_ends(*started)


@pytest.mark.parametrize(("program", "imports"), [(TWICE, 2), (LATER, 1)])
def test_what_the_work_needs_is_imported_once_for_all_processes(tmp_path: Path, program: str, imports: int) -> None:
    """Once by the program itself, where it needs it, and once by the process of which those of all work are copies."""
    (tmp_path / "prepared.py").write_text(PREPARED)
    (tmp_path / "program.py").write_text(program)
    imported = tmp_path / "imported"
    path = f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"
    environment = {**os.environ, "PYTHONPATH": path, "IMPORTED": str(imported)}
    subprocess.run([sys.executable, str(tmp_path / "program.py")], env=environment, check=True, timeout=120)
    assert len(imported.read_text().split()) == imports


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
    copied = int(Path(f"/proc/{child}/stat").read_text().rsplit(")", 1)[1].split()[1])
    assert copied != process.pid
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert_ends(child, copied)


def assert_ends(*pids: int) -> None:
    """Wait for processes to end; those that do not are killed, and named."""
    for _ in range(100):
        left = [pid for pid in pids if alive(pid)]
        if not left:
            return
        time.sleep(0.1)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    raise AssertionError(f"processes {left} were left behind")


def alive(pid: int) -> bool:
    """Return True if a process runs: one that ended and that nobody waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
