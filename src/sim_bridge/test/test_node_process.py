"""How the simulator's process starts and ends."""

import os
import signal
import subprocess
import sys

import pytest
from ros_domain import next_domain

for package in ("rclpy", "cliport_interfaces", "control_msgs"):
    pytest.importorskip(package, exc_type=ImportError)


ENVIRONMENT = os.environ | {"ROS_DOMAIN_ID": str(next_domain())}


def start_node(*arguments):
    command = [sys.executable, "-m", "sim_bridge.node", "--ros-args", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=ENVIRONMENT)


def check_one_line(output, *words):
    """Check that there is an error for each word, of one line, in that order, and nothing else."""
    lines = [line for line in output.splitlines() if not line.startswith("pybullet build")]
    assert len(lines) == len(words), output
    for line, word in zip(lines, words, strict=True):
        assert line.startswith("error: ")
        assert word in line


def test_a_bad_parameter_ends_in_one_line():
    process = start_node("-p", "task:=put-blocks-in-bowls-seen-colours")
    output, _ = process.communicate(timeout=30.0)
    assert process.returncode == 1
    check_one_line(output, "put-blocks-in-bowls-seen-colors")


def test_each_of_several_bad_parameters_is_one_line():
    """One process tries them one after the other: to start one takes seconds."""
    given = ("camera_rate:=-5.0", "seed:=many", "trajectory_log:=/no/such/folder/log")
    script = "import sys; from sim_bridge.node import main; " + (
        "raise SystemExit(sum(2**i * main(['--ros-args', '-p', word]) for i, word in enumerate(sys.argv[1:])))"
    )
    command = [sys.executable, "-c", script, *given]
    run = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=ENVIRONMENT, timeout=90.0
    )
    check_one_line(run.stdout, "camera_rate", "seed", "trajectory_log")
    assert run.returncode == 0b111


def test_sigterm_ends_it_cleanly():
    process = start_node()
    for line in process.stdout:
        if "scene:" in line:
            break
    process.send_signal(signal.SIGTERM)
    try:
        output, _ = process.communicate(timeout=15.0)
    finally:
        process.kill()
    assert process.returncode == 0, output
    assert "Traceback" not in output
