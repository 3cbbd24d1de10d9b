"""A node that once was behind keeps the room of a few pictures at most."""

from __future__ import annotations

import array
import os
import select
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rclpy
from late_reader import MESSAGES
from rclpy.qos import QoSProfile
from ros_domain import next_domain
from std_msgs.msg import UInt8MultiArray

MESSAGE_MB = 4.0
KEPT_MB = 3 * MESSAGE_MB  # more than before, at most; five messages that wait leave 20 MB


@pytest.mark.timeout(60)
def test_few_pictures_wait_for_a_late_reader() -> None:
    """Fast DDS keeps the room of all that ever waited."""
    domain, topic = next_domain(), "/large"
    command = [sys.executable, str(Path(__file__).with_name("late_reader.py")), topic]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node("large_writer", context=context)
    writer = node.create_publisher(UInt8MultiArray, topic, QoSProfile(depth=2))
    message = UInt8MultiArray(data=array.array("B", bytes(int(MESSAGE_MB * 2**20))))
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as reader:
        try:
            stdin, stdout = reader.stdin, reader.stdout
            assert stdin is not None and stdout is not None

            def heard() -> str:
                """Publish until the reader says something, and return it; not what Fast DDS has to say there."""
                said = "RTPS"
                while "RTPS" in said:
                    while not select.select([stdout], [], [], 0.1)[0]:
                        writer.publish(message)
                    said = stdout.readline().strip()
                return said

            assert heard() == "ready"
            at_first = float(heard())
            for _ in range(MESSAGES):
                writer.publish(message)
                time.sleep(0.1)
            stdin.write("\n")
            stdin.flush()
            after = float(heard())
            assert reader.wait(20.0) == 0  # killed, it would leave its shared memory
        finally:
            reader.kill()
            node.destroy_node()
            context.shutdown()
    assert after <= at_first + KEPT_MB
