"""A robot description that the arm's driver publishes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", exc_type=ImportError)

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import next_domain
from std_msgs.msg import String

from panda_executor import node_description
from panda_executor.errors import ExecutorError
from panda_executor.node_description import description_text


@pytest.fixture
def node() -> Iterator[Node]:
    rclpy.init(domain_id=next_domain())
    made = Node("reader")
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


def test_a_latched_description_is_heard(node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node_description, "_PATIENCE", 60.0)
    publisher = node.create_publisher(
        String, "/robot_description", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    publisher.publish(String(data="<robot name='mine'/>"))
    assert description_text(node, "topic:/robot_description") == "<robot name='mine'/>"


def test_a_path_stays_one_and_a_topic_nobody_publishes_is_named(node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    assert description_text(node, "/a/path.urdf") == "/a/path.urdf"
    monkeypatch.setattr(node_description, "_PATIENCE", 0.1)
    with pytest.raises(ExecutorError, match=r"no robot description on /nobody for 0\.1 s: is the arm's driver running"):
        description_text(node, "topic:/nobody")
