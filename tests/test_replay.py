"""A recorded episode through perception and policy server, as real processes: it proposes, and nothing moves."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import next_domain

from cliport_benchmark.graph_process import GraphProcess
from cliport_benchmark.record import ExpertRecorder, RecordConfig, Result
from cliport_episodes.reader import Episode, read_episode
from cliport_interfaces.msg import PolicyStatus
from cliport_policy.offline import main as offline

TASK = "put-blocks-in-bowls-seen-colors"
SEED = 1
DELAY_S = 12.0  # that the nodes get to start


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = tmp_path_factory.mktemp("replay") / "set"
    recorder = ExpertRecorder(RecordConfig(TASK, "test", SEED, 1), folder, lambda: 1_000_000_000_000)
    recorded = recorder.record(0)
    recorder.close()
    assert recorded.result is Result.SUCCEEDED
    return read_episode(folder / "episodes" / recorded.name)


@pytest.fixture(scope="module")
def proposed(episode: Episode, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[int, list[float]]]:
    """Stamp [ns] and pick x, y [m] of the steps that an offline run holds for undone."""
    out = tmp_path_factory.mktemp("replay") / "offline"
    assert offline(["--bag", str(episode.path), "--out", str(out), "--worst", "0"]) == 0
    steps = json.loads((out / "offline.json").read_text())["steps"]
    return [
        (record.record.stamp_ns, step["predicted_pick"][:2])
        for step, record in zip(steps, episode.steps, strict=True)
        if step["done_probability"] < 0.5
    ]


class Listener:
    """Listener to the policy server's words, and to anything that could move."""

    def __init__(self, domain: int) -> None:
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, domain_id=domain)
        self.node = Node("listener", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.picks: list[PoseStamped] = []
        self.recorded: list[PoseStamped] = []
        self.states: list[int] = []
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.node.create_subscription(PoseStamped, "/cliport/pick_pose", self.picks.append, 10)
        self.node.create_subscription(PoseStamped, "/recorded/pick_pose", self.recorded.append, 10)
        self.node.create_subscription(PolicyStatus, "/cliport/status", lambda m: self.states.append(m.state), latched)

    def wait(self, seconds: float, done: Callable[[], bool]) -> bool:
        deadline = time.monotonic() + seconds
        while not done() and time.monotonic() < deadline:
            self._executor.spin_once(0.1)
        return done()

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def replay(episode: Episode, tmp_path: Path) -> Iterator[tuple[GraphProcess, Listener]]:
    domain = next_domain()
    arguments = {"bag": str(episode.path), "delay": str(DELAY_S), "rate": "2.0"}
    listener = Listener(domain)
    with GraphProcess("replay.launch.yaml", arguments, tmp_path / "log", {"ROS_DOMAIN_ID": str(domain)}) as graph:
        yield graph, listener
        assert "Traceback" not in graph.log_text(), graph.log_tail(40)
    listener.close()
    assert graph.pids() == []


def test_a_replayed_episode_brings_the_proposals_of_an_offline_run(
    proposed: list[tuple[int, list[float]]], replay: tuple[GraphProcess, Listener], episode: Episode
) -> None:
    graph, listener = replay
    assert proposed
    assert listener.wait(40.0, lambda: len(listener.picks) >= len(proposed)), graph.log_tail(40)
    assert listener.wait(5.0, lambda: len(listener.recorded) >= len(episode.steps))
    assert listener.wait(5.0, lambda: PolicyStatus.STATE_WAITING_FOR_APPROVAL in listener.states)
    assert PolicyStatus.STATE_EXECUTING not in listener.states
    assert not any("panda_executor" in name for name in listener.node.get_node_names())
    for message, (stamp_ns, pick) in zip(listener.picks, proposed, strict=True):
        at = message.pose.position
        assert (at.x, at.y) == pytest.approx(pick, abs=1e-3)
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns
