"""Which test fails, is tried again or ends its process is said at once: a run may be ended before its summary."""

import shutil
import subprocess
import sys
from pathlib import Path

CONFTEST = Path(__file__).parents[1] / "conftest.py"
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


def test_each_failure_is_named_before_the_summary(tmp_path: Path) -> None:
    shutil.copy(CONFTEST, tmp_path)
    (tmp_path / "test_some.py").write_text(TESTS)
    command = [sys.executable, "-m", "pytest", "-n", "1", "--max-worker-restart", "0", "-p", "no:cacheprovider"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    at_once, _, _ = ran.stdout.partition("= FAILURES =")
    assert "tried again after 0 s: test_some.py::test_late: AssertionError: no answer yet" in at_once, ran.stdout
    assert "failed after 0 s: test_some.py::test_wrong: AssertionError: seven is not eight" in at_once
    assert "test_some.py::test_deadly: worker 'gw0' crashed" in at_once
