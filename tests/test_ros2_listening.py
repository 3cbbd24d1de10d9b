"""A listener of `ros2` whose participant is sent nothing: another one listens in its place."""

from __future__ import annotations

import time

import pytest
from rclpy.qos import qos_profile_system_default
from ros2cli_small import listening
from ros2cli_small.graph import command_node
from ros2cli_small.listening import Listener
from ros_domain import next_domain
from std_msgs.msg import String


@pytest.fixture
def own_domain(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))


@pytest.mark.parametrize("speaks_to", [1, 2])
def test_a_second_participant_listens_where_the_first_hears_nothing(own_domain, monkeypatch, speaks_to):
    """The publisher speaks once that many listen: with 2, the first one has been silent too long."""
    monkeypatch.setattr(listening, "PATIENCE", 0.3)
    heard: list[str] = []
    sent = 0
    with command_node() as node:
        publisher = node.create_publisher(String, "/words", 10)
        listener = Listener(
            node, String, "/words", lambda message: heard.append(message.data), qos_profile_system_default
        )

        def enough() -> bool:
            nonlocal sent
            if publisher.get_subscription_count() >= speaks_to and sent < 3:
                publisher.publish(String(data=str(sent)))
                sent += 1
            return len(heard) >= 3

        deadline = time.monotonic() + 30.0
        listener.spin_until(lambda: enough() or time.monotonic() > deadline)
    assert heard == ["0", "1", "2"]  # each once, whoever heard it
