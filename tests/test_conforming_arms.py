"""The conformance test on each arm that runs here: PyBullet's, and franky-sim behind the driver with either preset."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest
from franky_bench import Processes
from ros_domain import next_domain

from panda_driver.conformance.checks import CHECKS

PROMISED_RATE = "100"  # of the driver's joint states [Hz]
TIMEOUT = 400.0  # of one arm's checks [s]
HAS_FRANKY = find_spec("franky") is not None and find_spec("franky_sim") is not None

pytestmark = pytest.mark.soak


def _pybullet(processes: Processes, arm: str) -> None:
    processes.node("arm", "sim_bridge.node", robot=arm)


def _franky(processes: Processes, arm: str) -> None:
    from franky_bench import TableArm

    given = {"robot_ip": TableArm(processes).address, "arm": arm, "realtime": False}
    processes.node("arm", "panda_driver.node", publish_clock=True, use_sim_time=True, **given)


@pytest.mark.parametrize("arm", ["fr3", "panda"])
@pytest.mark.parametrize(
    ("start", "options"),
    [
        (_pybullet, ()),
        pytest.param(
            _franky, ("--rate", PROMISED_RATE), marks=pytest.mark.skipif(not HAS_FRANKY, reason="needs franky")
        ),
    ],
    ids=["pybullet", "franky-sim"],
)
def test_an_arm_conforms(
    tmp_path: Path, start: Callable[[Processes, str], None], options: tuple[str, ...], arm: str
) -> None:
    domain = next_domain()
    processes = Processes(tmp_path, domain)
    start(processes, arm)
    main = "import sys; from panda_driver.conformance.main import main; sys.exit(main())"
    command = [sys.executable, "-c", main, "--arm", arm, *options, "--ros-args", "-p", "use_sim_time:=true"]
    environment = processes.environment
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, env=environment)
    processes.close()
    assert done.returncode == 0, done.stdout + done.stderr + processes.log("arm")[-2000:]
    assert f"{len(CHECKS)} of {len(CHECKS)} checks passed" in done.stdout
