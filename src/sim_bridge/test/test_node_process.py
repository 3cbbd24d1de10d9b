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


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("task:=put-blocks-in-bowls-seen-colours", "put-blocks-in-bowls-seen-colors"),
        ("camera_rate:=-5.0", "camera_rate"),
        ("seed:=many", "seed"),
        ("trajectory_log:=/no/such/folder/log", "trajectory_log"),
    ],
)
def test_bad_parameters_end_in_one_line(argument, words):
    process = start_node("-p", argument)
    output, _ = process.communicate(timeout=30.0)
    errors = [line for line in output.splitlines() if not line.startswith("pybullet build")]
    assert process.returncode == 1
    assert len(errors) == 1, output
    assert errors[0].startswith("error: ")
    assert words in errors[0]


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
