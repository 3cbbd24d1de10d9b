"""A node that once was behind does not keep the memory of all that waited for it."""

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
from hardware_times import ROOT
from late_reader import QUEUE
from rclpy.qos import QoSProfile
from ros_domain import next_domain
from std_msgs.msg import UInt8MultiArray

MESSAGE_MB = 4.0
HELD_MB = (QUEUE - 1) * MESSAGE_MB  # by a reader that is behind, at least
KEPT_MB = 2 * MESSAGE_MB  # afterwards, at most: the last message, and the room of one


@pytest.mark.timeout(60)
def test_what_waited_for_a_late_reader_is_given_back() -> None:
    """Without our profile of Fast DDS the reader keeps all that it held."""
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
                """Publish until the reader says something, and return it."""
                while not select.select([stdout], [], [], 0.1)[0]:
                    writer.publish(message)
                return stdout.readline().strip()

            assert heard() == "ready"
            at_first = float(heard())
            for _ in range(2 * QUEUE):
                writer.publish(message)
                time.sleep(0.1)
            stdin.write("\n")
            stdin.flush()
            behind, after = float(heard()), float(heard())
            assert reader.wait(20.0) == 0  # killed, it would leave its shared memory
        finally:
            reader.kill()
            node.destroy_node()
            context.shutdown()
    assert behind >= at_first + HELD_MB, "it was not behind"
    assert after <= at_first + KEPT_MB


@pytest.mark.parametrize(("own", "counts"), [("", "1"), ("/own.xml", "")])
def test_only_our_profile_is_told_to_count(own: str, counts: str) -> None:
    """Of a user's own profile, written for what ROS 2 sets itself, no more may count than did."""
    names = ("FASTRTPS_DEFAULT_PROFILES_FILE", "RMW_FASTRTPS_USE_QOS_FROM_XML")
    environment = {name: value for name, value in os.environ.items() if name not in names} | {names[0]: own}
    command = ["sh", "-c", f'. ./env.sh && echo "${names[0]} ${names[1]}"']
    found = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=30).stdout
    profile, _, told = found.strip("\n").partition(" ")
    assert told == counts and Path(profile).name == Path(own or "fastdds.xml").name
