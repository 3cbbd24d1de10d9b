"""The guard's node: its limits, and what it says of a cancel that nobody takes."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.parameter import Parameter
from rclpy.time import Time
from ros_domain import next_domain

from panda_executor.errors import ExecutorError
from panda_executor.guard import Fault
from panda_executor.node_guard import GuardNode
from panda_model import load_preset


@pytest.fixture
def ros() -> Iterator[None]:
    rclpy.init(domain_id=next_domain())
    yield
    rclpy.try_shutdown()


def test_it_says_which_cancel_it_cannot_send(ros: None, monkeypatch: pytest.MonkeyPatch) -> None:
    node = GuardNode()
    said: list[str] = []
    logger = logging.getLogger("guard")
    monkeypatch.setattr(logger, "error", said.append)
    monkeypatch.setattr(node, "get_logger", lambda: logger)
    monkeypatch.setattr(node._guard, "tick", lambda now: Fault.EXECUTOR_SILENT)
    node._tick()
    services = ", ".join(f"{action}/_action/cancel_goal" for action in load_preset().motion_actions)
    assert said == [
        f"the executor gives no sign of work done: cannot cancel at {services}: no such service; use the arm's own stop"
    ]
    node._tick()
    assert len(said) == 1, "the same line is not said twice in five seconds"
    monkeypatch.setattr(node._guard, "tick", lambda now: Fault.JOINT_STATES_LOST)
    node._tick()
    assert len(said) == 2 and said[1].startswith("the joint states ended")
    node._said_at -= 5.1
    node._tick()
    assert len(said) == 3 and said[2] == said[1]
    node.destroy_node()


def test_its_limits_are_parameters(ros: None) -> None:
    settings = {"silence": 1.0, "joint_silence": 2.0, "max_joint_age": 3.0, "max_ahead": 0.5, "arm_joints": ["a", "b"]}
    node = GuardNode(parameter_overrides=[Parameter(name, value=value) for name, value in settings.items()])
    config = node._guard.config
    assert (config.silence, config.joint_silence, config.max_age, config.max_ahead) == (1.0, 2.0, 3.0, 0.5)
    node._guard.on_joints(("a", "b"), (0.0, 0.0), 2.5)
    assert node._guard._age == 2.5
    node.destroy_node()
    with pytest.raises(ExecutorError, match="silence must be finite, got inf"):
        GuardNode(parameter_overrides=[Parameter("silence", value=float("inf"))])


def test_what_it_did_is_reported_with_its_time(ros: None, monkeypatch: pytest.MonkeyPatch) -> None:
    node = GuardNode()
    reports: list[DiagnosticArray] = []
    monkeypatch.setattr(node, "_diagnostics", SimpleNamespace(publish=reports.append))
    before = node.get_clock().now()
    node._report()
    node._last = Fault.EXECUTOR_SILENT
    node._report()
    assert [report.status[0].level for report in reports] == [DiagnosticStatus.OK, DiagnosticStatus.WARN]
    assert [report.status[0].message for report in reports] == [
        "watching", "last cancelled everything because the executor gives no sign of work done"
    ]  # fmt: skip
    assert all(Time.from_msg(report.header.stamp, before.clock_type) >= before for report in reports)
    node.destroy_node()
