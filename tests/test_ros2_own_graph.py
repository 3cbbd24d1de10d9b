"""`ros2 topic list` on the simulated robot's graph, with all cores busy.

`make soak PYTEST_ARGS=tests/test_ros2_own_graph.py` runs this, some minutes.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
import rclpy
from busy_cores import busy_cores
from ros2_process import ros2
from ros_domain import next_domain

from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_process import GraphProcess

pytestmark = [pytest.mark.soak, pytest.mark.timeout(1800)]


def seen_by_a_node(domain: int) -> set[str]:
    """Return what a node of this process sees of a graph, once it has seen nothing new for 10 s; hidden ones not."""
    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node("onlooker", context=context)
    seen: set[str] = set()
    since = time.monotonic()
    while time.monotonic() - since < 10.0:
        now = {name for name, _ in node.get_topic_names_and_types() if "/_" not in name}
        if not now <= seen:
            seen, since = seen | now, time.monotonic()
        time.sleep(0.1)
    node.destroy_node()
    context.try_shutdown()
    return seen


def test_topic_list_is_complete_in_20_of_20_tries_with_busy_cores(tmp_path: Path) -> None:
    domain = next_domain()
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    with GraphProcess("sim.launch.yaml", {}, tmp_path / "log", environment) as graph:
        with GraphClient("ready", domain) as client:
            client.wait_ready(300.0, lambda: graph.healthy)
        there = seen_by_a_node(domain)
        with busy_cores():
            tries = [set(ros2(environment, "topic", "list").stdout.splitlines()) for _ in range(20)]
        assert graph.healthy, graph.log_tail(40)
    print(f"{len(there)} topics; listed: {[len(found) for found in tries]}")
    assert len(there) >= 25 and "/cliport/status" in there
    assert [there - found for found in tries] == [set()] * 20
    assert [found - there for found in tries] == [set()] * 20
