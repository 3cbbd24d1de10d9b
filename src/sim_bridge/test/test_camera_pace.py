"""Simulated time waits for the camera: its pictures come at their rate, whatever the pace that is asked for."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest
from ros_domain import next_domain

pytest.importorskip("rclpy", exc_type=ImportError)
pytest.importorskip("cliport_interfaces", exc_type=ImportError)
pytest.importorskip("control_msgs", exc_type=ImportError)

from simulator_client import Client

from sim_bridge.conversions import time_from_msg

INFO = "/camera/color/camera_info"
RATE = 20.0


@pytest.fixture
def client() -> Iterator[Client]:
    """A client of a simulator that is to run a hundred times as fast as real time, which no machine does."""
    domain = next_domain()
    command = [sys.executable, "-m", "sim_bridge.node", "--ros-args", "-p", "real_time_factor:=100.0"]
    process = subprocess.Popen(
        [*command, "-p", f"camera_rate:={RATE}"],
        stdout=subprocess.DEVNULL,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
    )
    client = Client(domain)
    try:
        client.until(lambda: process.poll() is None and client.seen[INFO], 60.0)
        yield client
    finally:
        client.close()
        process.terminate()
        process.wait(15.0)


def test_no_picture_is_left_out(client: Client) -> None:
    client.until(lambda: len(client.seen[INFO]) >= 30, 60.0)
    stamps = [time_from_msg(message.header.stamp) for _, message in client.seen[INFO]]
    assert np.allclose(np.diff(stamps[5:]), 1.0 / RATE, atol=0.02), np.diff(stamps)
