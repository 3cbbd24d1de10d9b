"""How `make test` shares tests between processes, and tells of those that fail."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).parents[1] / "conftest.py"
PYTEST = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-p", "no:dash"]
TESTS = """
import os, signal
import pytest

tries = []

@pytest.mark.flaky(reruns=2)
def test_late():
    tries.append(1)
    assert len(tries) > 1, "no answer yet"

def test_wrong():
    assert False, "seven is not eight"

def test_deadly():
    os.kill(os.getpid(), signal.SIGKILL)
"""


SHARED = """
import os, time
import pytest

@pytest.mark.parametrize("number", range(3))
def test_where(number):
    if os.environ["PYTEST_XDIST_WORKER"] != "gw2":
        time.sleep(0.3)  # who has nothing else left takes what waits, too
    with open(os.environ["WHERE"], "a") as file:
        file.write(f"{os.environ['PYTEST_XDIST_WORKER']} {os.path.relpath(__file__)}\\n")
"""


def test_each_failure_is_named_before_the_summary(tmp_path: Path) -> None:
    """A run may be ended before that."""
    shutil.copy(CONFTEST, tmp_path)
    (tmp_path / "test_some.py").write_text(TESTS)
    command = [*PYTEST, "-n", "1", "--max-worker-restart", "0"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    at_once, _, _ = ran.stdout.partition("= FAILURES =")
    assert "tried again after 0 s: test_some.py::test_late: AssertionError: no answer yet" in at_once, ran.stdout
    assert "failed after 0 s: test_some.py::test_wrong: AssertionError: seven is not eight" in at_once
    assert "test_some.py::test_deadly: worker 'gw0' crashed" in at_once


def test_the_last_of_three_processes_has_what_mostly_waits(tmp_path: Path) -> None:
    shutil.copy(CONFTEST, tmp_path)
    waiting = {"tests/test_ros2_a.py", "src/one/test/test_node.py", "src/two/test/test_ros_b.py"}
    others = {
        "tests/test_c.py",
        "tests/test_d.py",
        "src/one/test/test_node_e.py",
        "src/two/test/test_f.py",
        "src/test_three/test_g.py",
    }
    for path in (tmp_path / name for name in waiting | others):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(SHARED)
    command = [*PYTEST, "-n", "3", "--no-loadscope-reorder", "--import-mode", "importlib", "src", "tests"]
    where = tmp_path / "where"
    subprocess.run(command, cwd=tmp_path, env={**os.environ, "WHERE": str(where)}, check=True, timeout=120)
    ran = [line.split() for line in where.read_text().splitlines()]
    assert len(ran) == 3 * len(waiting | others)
    assert {name for process, name in ran if process == "gw2"} == waiting
    assert {name for process, name in ran if process != "gw2"} == others
    graphs = {process for process, name in ran if name.startswith("tests/") and name in others}
    assert len(graphs) == 1, "what starts graphs stays together"
