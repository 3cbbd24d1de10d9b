"""Nodes as processes: interrupts at any moment, faults at start and while running."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest
from ros_domain import next_domain

PREFACE = """
import os, signal, sys, threading
from rclpy.node import Node
from cliport_core.errors import CoreError
from cliport_core.ros_running import run_node

def interrupt():
    for _ in range(3):
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
"""

BAD_SETTING = """
def make(fail):
    interrupt()
    raise CoreError("the setting\\n  is bad")
"""
INTERRUPTED = """
def make(fail):
    interrupt()
    return Node("quiet")
"""
LATER_FAULT = """
def make(fail):
    threading.Timer(0.2, fail, (RuntimeError("the motor is gone"),)).start()
    return Node("faulty")
"""
DEFECT = """
def make(fail):
    node = Node("defective")
    node.create_timer(0.05, lambda: 1 / 0)
    return node
"""
RUN = "\nsys.exit(run_node(make, (CoreError,), [], lambda node: interrupt() or print('closed')))\n"


def start(script: str) -> subprocess.Popen[str]:
    environment = os.environ | {"ROS_DOMAIN_ID": str(next_domain())}
    command = [sys.executable, "-c", PREFACE + script + RUN]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


@pytest.mark.parametrize(
    ("script", "status", "out", "error"),
    [
        (BAD_SETTING, 1, "", "error: the setting is bad\n"),
        (INTERRUPTED, 0, "closed\n", ""),
        (LATER_FAULT, 1, "closed\n", "error: the motor is gone\n"),
    ],
    ids=["bad setting", "at start", "later"],
)
def test_interrupts_never_hide_what_happened(script: str, status: int, out: str, error: str) -> None:
    process = start(script)
    assert (*process.communicate(timeout=60), process.returncode) == (out, error, status)


def test_a_defect_in_a_callback_ends_the_process() -> None:
    process = start(DEFECT)
    out, error = process.communicate(timeout=60)
    assert (out, process.returncode) == ("closed\n", 1)
    assert error.endswith("error: division by zero\n")


def test_a_node_ends_when_asked_to() -> None:
    process = start('def make(fail):\n    print("here", flush=True)\n    return Node("patient")\n')
    assert process.stdout
    assert process.stdout.readline() == "here\n"
    time.sleep(0.5)
    process.send_signal(signal.SIGTERM)
    assert (*process.communicate(timeout=60), process.returncode) == ("closed\n", "", 0)


def test_a_signal_that_does_not_wake_the_waiting_thread_is_heard_all_the_same() -> None:
    """As one that comes just before it waits: here another thread takes it, which is no matter of luck."""
    process = start("""
def make(fail):
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGTERM)).start()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    return Node("deaf")
""")
    try:
        assert process.communicate(timeout=20)[0].endswith("closed\n") and process.returncode == 0
    finally:
        process.kill()


@pytest.mark.parametrize("arguments", [["-p", "nope"], ["--params-file", "/no/such.yaml"], ["-p", "rate:=[1,"]])
def test_bad_ros_arguments_are_one_line(arguments: list[str]) -> None:
    script = f"sys.argv += ['--ros-args', *{arguments}]\nmake = None\n"
    command = [sys.executable, "-c", PREFACE + script + RUN.replace("[], ", "sys.argv, ")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1 and ended.stdout == ""
    *logged_by_rcl, line = ended.stderr.splitlines()
    assert len(logged_by_rcl) <= 1 and "Traceback" not in ended.stderr
    assert line.startswith("error: ") and arguments[1] in line and "--ros-args" in line
