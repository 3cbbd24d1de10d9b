"""`tools/setup` where all is set up: nothing is downloaded again, with a patched Python and without a network too."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from setup_shell import program

ROOT = Path(__file__).parents[1]
STEPS = ("system libraries", "virtual environment", "python packages", "cmake files of the ROS wheels", "ROS workspace")
# The interpreter of .venv: it says another version than its own, and its pip writes down what it is asked for.
PYTHON = f"""
case $* in
    *"-m pip"*) echo "$*" >>.setup/asked ;;
    "-c"*) exec {sys.executable} -c "import sys, types
numbers = tuple(map(int, '$VERSION'.split('.')))
sys.version_info = type('Numbers', (tuple,), dict(major=numbers[0], minor=numbers[1]))((*numbers, 'final', 0))
exec(sys.argv[1])" "$2" ;;
    *repair_underlay*) echo repaired ;;
esac
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with the steps of set-up, whose slow parts are played."""
    shutil.copytree(ROOT / "tools", tmp_path / "tools", ignore=shutil.ignore_patterns("__pycache__"))
    for file in [*ROOT.glob("requirements*.txt"), ROOT / "colcon.meta"]:
        shutil.copy(file, tmp_path)
    (tmp_path / "src").mkdir()
    program(tmp_path / "tools/build", "echo built >>.setup/built; mkdir -p install; touch install/local_setup.sh")
    program(tmp_path / ".venv/bin/python", PYTHON)
    (tmp_path / ".venv/pyvenv.cfg").write_text("include-system-site-packages = false\n")
    program(
        tmp_path / "bin/ldconfig",
        'printf "%s (libc6)\\n" libgomp.so.1 libusb-1.0.so.0 libGL.so.1 libEGL.so.1 libX11.so.6',
    )
    return tmp_path


def set_up(checkout: Path, version: str) -> subprocess.CompletedProcess[str]:
    kept = {
        name: value for name, value in os.environ.items() if name not in ("ROS_DISTRO", "EXTRAS", "TORCH", "LOCKED")
    }
    environment = {**kept, "VERSION": version, "PATH": f"{checkout}/bin:{os.environ['PATH']}"}
    return subprocess.run(
        [checkout / "tools/setup"],
        env=environment,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=60,
    )


def asked(checkout: Path) -> int:
    return (checkout / ".setup/asked").read_text().count(" install ")


def test_another_patch_of_python_downloads_and_builds_nothing(checkout: Path) -> None:
    first = set_up(checkout, "3.12.3")
    assert first.returncode == 0, first.stdout + first.stderr
    assert asked(checkout) == 1
    again = set_up(checkout, "3.12.11")
    assert [line for line in again.stdout.splitlines() if "up to date" in line] == [
        f"[{number}/5] {step}: up to date" for number, step in enumerate(STEPS, 1)
    ]
    assert asked(checkout) == 1 and (checkout / ".setup/built").read_text() == "built\n"


def test_another_minor_version_of_python_downloads_anew(checkout: Path) -> None:
    set_up(checkout, "3.12.3")
    assert set_up(checkout, "3.13.0").returncode == 0
    assert asked(checkout) == 2


@pytest.mark.soak
@pytest.mark.skipif((ROOT / ".venv").is_symlink(), reason="this checkout shares another's .venv")
def test_a_second_setup_needs_no_network() -> None:
    """In a network namespace of its own, and with dead proxies where this user may not have one."""
    alone = ["unshare", "-n"] if os.geteuid() == 0 else ["unshare", "-rn"]
    if subprocess.run([*alone, "true"], capture_output=True).returncode != 0:
        alone = []
    dead = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    done = subprocess.run(
        [*alone, "make", "setup"], cwd=ROOT, env={**os.environ, **dead}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(": up to date") == len(STEPS)
