"""The client of a running graph and the graph's process, with the other end played."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cliport_interfaces.msg")

from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import Image, JointState

from cliport_benchmark import graph_client, graph_process
from cliport_benchmark.errors import BenchmarkError, SceneError
from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_process import GraphProcess
from cliport_core import topics
from cliport_interfaces.msg import PolicyStatus
from cliport_interfaces.srv import ResetTask

TASK = "put-blocks-in-bowls-seen-colors"
OVERLAY = graph_client.OVERLAYS[0]


class Clock:
    """Time that passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.now, self.slept = 100.0, list[float]()
        self.passed: Callable[[float], None] = lambda seconds: None

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds
        self.passed(seconds)


class Simulator:
    """The clock of a simulator that runs at a pace of the client's."""

    def __init__(self, client: GraphClient, at: float) -> None:
        self.client, self.at, self.gone, self.pace = client, at, 0.0, 1.0
        self.go_on(0.0)

    def go_on(self, seconds: float) -> None:
        self.gone += self.pace * seconds
        whole, rest = divmod(self.at + self.gone, 1.0)
        self.client._take_clock(ClockMessage(clock=Time(sec=int(whole), nanosec=int(1e9 * rest))))


class Service:
    """A service that answers after so many seconds."""

    srv_name = "/sim/score"

    def __init__(self, clock: Clock, after: float, response: Any) -> None:
        self.clock, self.after, self.response, self.asked = clock, after, response, list[Any]()

    def call_async(self, request: Any) -> Any:
        self.asked.append(request)
        end = self.clock.now + self.after
        return SimpleNamespace(done=lambda: self.clock.now >= end, result=lambda: self.response)

    def service_is_ready(self) -> bool:
        return self.response is not None


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(graph_client, "time", made)
    return made


@pytest.fixture
def client(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> GraphClient:
    """A client without a node."""
    node = SimpleNamespace(
        create_publisher=lambda *_: SimpleNamespace(publish=lambda _: None, get_subscription_count=lambda: 1),
        create_client=lambda *_: Service(clock, 0.0, None),
        create_subscription=lambda *_: None,
        count_publishers=lambda topic: 0,
    )
    fakes = {"Context": lambda: SimpleNamespace(init=lambda domain_id: None), "create_node": lambda name, context: node}
    monkeypatch.setattr(graph_client, "rclpy", SimpleNamespace(**fakes))
    monkeypatch.setattr(graph_client, "SpinThread", lambda *_: None)
    return GraphClient()


def picture(value: int) -> Image:
    return Image(height=2, width=3, data=bytes([value] * 18))


def test_a_scene_is_made_or_refused_in_the_simulators_words(client: GraphClient, clock: Clock) -> None:
    answer = SimpleNamespace(success=True, max_steps=14, redraws=2, instruction="put it there", message="no place")
    client._reset = service = Service(clock, 39.9, answer)  # type: ignore[assignment]
    assert client.max_steps == 0 and client.reset(TASK, "test", 3, "put it") == "put it there"
    assert (client.max_steps, client.redraws) == (14, 2)
    (asked,) = service.asked
    assert (asked.task, asked.split, asked.seed, asked.instruction) == (TASK, "test", 3, "put it")
    answer.success = False
    with pytest.raises(SceneError, match="no place"):
        client.reset(TASK, "test", 3)
    service.after = 40.1
    with pytest.raises(BenchmarkError, match="/sim/score did not answer within 40 s"):
        client.reset(TASK, "test", 3)


def test_the_score_is_asked_for_once_things_lie_still(client: GraphClient, clock: Clock) -> None:
    answer = SimpleNamespace(
        success=True, score=0.5, done=True, broken=True, instruction="put it there", message="no task"
    )
    client._score = Service(clock, 0.0, answer)  # type: ignore[assignment]
    simulator = Simulator(client, 7.5)
    clock.passed = simulator.go_on
    assert client.score() == 0.5 and simulator.gone == pytest.approx(2.5, abs=0.03)
    assert pytest.approx(2.5) == graph_client.SimConfig().max_settle_s + 0.5
    simulator.pace = 0.25
    assert client.judged() == (0.5, True, "put it there", True) and simulator.gone == pytest.approx(5.0, abs=0.06)
    assert clock.now == pytest.approx(100.0 + 2.5 + 10.0, abs=0.1), "a slow simulator is waited for"
    simulator.pace = 0.0
    with pytest.raises(BenchmarkError, match=r"^the simulator's clock has not gone on by 2\.5 s$"):
        client.judged()
    answer.success = False
    with pytest.raises(BenchmarkError, match="no task"):
        client.progress()
    answer.success, client._score.after = True, 10.1  # type: ignore[attr-defined]
    with pytest.raises(BenchmarkError, match="did not answer within 10 s"):
        client.progress()


def test_beside_an_arm_without_a_clock_wall_time_counts(client: GraphClient, clock: Clock) -> None:
    answer = SimpleNamespace(success=True, score=0.5, done=False, broken=False, instruction="")
    client._score = Service(clock, 0.0, answer)  # type: ignore[assignment]
    assert client.score() == 0.5 and clock.now == pytest.approx(102.5, abs=0.03)


def test_what_is_missing_is_named(client: GraphClient, clock: Clock) -> None:
    words = f"not ready after 3 s: no /sim/score, no /sim/score, no {topics.STATUS}, no {topics.COLOR}$"
    with pytest.raises(BenchmarkError, match=words):
        client.wait_ready(3.0)
    with pytest.raises(BenchmarkError, match="the graph ended before it was ready"):
        client.wait_ready(3.0, lambda: False)
    client._reset = client._score = Service(clock, 0.0, 1)  # type: ignore[assignment]
    client._take_status(PolicyStatus())
    client._take_image(topics.COLOR, picture(1))
    client.wait_ready(3.0)
    client._node.count_publishers = lambda topic: topic == topics.CLOCK
    with pytest.raises(BenchmarkError, match=f"no {topics.CLOCK}$"):
        client.wait_ready(3.0)
    client._take_clock(ClockMessage())
    client.wait_ready(3.0)
    client._instruction.get_subscription_count = lambda: 0  # type: ignore[method-assign]
    with pytest.raises(BenchmarkError, match=f"no subscriber of {topics.INSTRUCTION}$"):
        client.wait_ready(3.0)


def test_a_motion_is_waited_for_and_timed(client: GraphClient, clock: Clock) -> None:
    sleep = clock.sleep

    def move(seconds: float) -> None:
        sleep(seconds)
        speed = 0.011 if clock.now > 100.5 else 0.009
        client._take_joints(JointState(name=["panda_joint1"], velocity=[-speed]))

    clock.sleep = move  # type: ignore[method-assign]
    assert client.seconds_to_motion("put it there", 20.0) == pytest.approx(0.502, abs=0.003)
    client._take_joints(JointState(name=["panda_joint1"], velocity=[0.5]))
    clock.sleep = sleep  # type: ignore[method-assign]
    began = clock.now
    client.wait_at_rest(20.0)
    assert clock.now - began == pytest.approx(0.5, abs=0.06)
    with pytest.raises(BenchmarkError, match="the arm did not move within 20 s: none"):
        client.seconds_to_motion("again", 20.0)
    client._take_joints(JointState(name=["panda_joint1"], velocity=[0.5]))
    clock.sleep = move  # type: ignore[method-assign]
    with pytest.raises(BenchmarkError, match="the arm still moves after 2 s"):
        client.wait_at_rest(2.0)


def test_an_instruction_ends_with_done_or_failed(client: GraphClient, clock: Clock) -> None:
    def ask(*statuses: PolicyStatus) -> graph_client.Ended:
        def publish(_: Any) -> None:
            clock.now += 2.0
            client._take_joints(JointState(name=["panda_joint1"], velocity=[0.5]))
            clock.now += 1.0
            for status in statuses:
                client._take_status(status)

        client._instruction = SimpleNamespace(publish=publish)  # type: ignore[assignment]
        return client.instruct_and_wait("put it there", 10.0)

    moving = PolicyStatus(state=PolicyStatus.STATE_EXECUTING, step=1)
    done = PolicyStatus(state=PolicyStatus.STATE_DONE, message="reached", step=2)
    failed = PolicyStatus(state=PolicyStatus.STATE_FAILED, message="lost", step=3)
    assert ask(moving, done) == (True, "reached", 2, 3.0, 2.0)
    assert ask(failed, done) == (False, "lost", 3, 3.0, 2.0)
    of_before = PolicyStatus(state=PolicyStatus.STATE_IDLE, message="nothing to do", instruction="")
    stopped = PolicyStatus(state=PolicyStatus.STATE_IDLE, message="stopped: call it", instruction="put it there")
    assert ask(of_before, done).message == "reached"
    with pytest.raises(BenchmarkError, match=r"^somebody stopped the policy: stopped: call it$"):
        ask(moving, stopped)


def test_pictures_of_the_present_scene_are_kept(client: GraphClient) -> None:
    frames: list[np.ndarray] = []
    client.on_frame = frames.append
    for topic, value in ((topics.COLOR, 1), (OVERLAY, 2), (OVERLAY, 3), (topics.COLOR, 4)):
        client._take_image(topic, picture(value))
    assert [frame[0, 0, 0] for frame in frames] == [1, 4] and client.camera_image().shape == (2, 3, 3)
    assert client.camera_image()[0, 0, 0] == 4
    assert [overlay[1, 2, 2] for overlay in client.overlays(OVERLAY)] == [2, 3]
    for sentence in ("the next one", ""):
        client.instruct(sentence)
    assert len(client.overlays(OVERLAY)) == 2, "those of the sentences before"
    answer = ResetTask.Response(success=True, instruction="another", max_steps=3, redraws=0)
    client._call = lambda *_: answer  # type: ignore[method-assign]
    client.reset(TASK, "test", 1)
    assert client.overlays(OVERLAY) == []


def test_the_log_of_a_graph(tmp_path: Path) -> None:
    graph = GraphProcess("sim.launch.yaml", {"task": TASK}, tmp_path / "log", {"ROS_DOMAIN_ID": "7"})
    assert graph._command == ["launch", "cliport_bringup", "sim.launch.yaml", f"task:={TASK}"]
    assert graph._environment["ROS_DOMAIN_ID"] == "7" and graph.log_text() == ""
    assert not graph.alive and not graph.healthy and graph.pids() == []
    graph.log_path.write_text("\n".join(map(str, range(20))))
    assert graph.log_tail() == "\n".join(map(str, range(5, 20))) and graph.log_tail(2) == "18\n19"
    graph._process = SimpleNamespace(poll=lambda: None, pid=-5)  # type: ignore[assignment]
    assert graph.alive and graph.healthy
    graph.log_path.write_text("x: process has died [pid 3]")
    assert graph.alive and not graph.healthy
    with pytest.raises(BenchmarkError, match="no process of the graph runs node"):
        graph.pid_of("node")


def test_a_graph_is_interrupted_then_terminated_then_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock, sent = Clock(), list[tuple[int, int, float]]()
    monkeypatch.setattr(graph_process, "time", clock)
    monkeypatch.setattr(
        graph_process, "_signal", lambda pid, number: sent.append((pid, number, round(clock.now - 100)))
    )
    graph = GraphProcess("sim.launch.yaml", {}, tmp_path / "log")
    graph.stop()
    assert sent == []
    graph._process = SimpleNamespace(poll=lambda: 0, pid=40)  # type: ignore[assignment]
    left = [41, 42]
    graph.pids = lambda: left  # type: ignore[method-assign]
    graph.stop()
    assert sent == [
        (40, signal.SIGINT, 0), (41, signal.SIGTERM, 12), (42, signal.SIGTERM, 12),
        (41, signal.SIGKILL, 17), (42, signal.SIGKILL, 17),
    ]  # fmt: skip
    assert clock.now == pytest.approx(122.0, abs=0.3)
    sent.clear()
    left.clear()
    graph.stop()
    assert sent == [(40, signal.SIGINT, 22)] and clock.now == pytest.approx(122.0, abs=0.3)


def test_processes_are_known_by_their_session(monkeypatch: pytest.MonkeyPatch) -> None:
    own, missing = os.getpid(), 2**30
    assert graph_process._session_of(own) == os.getsid(0) and own in graph_process._all_pids()
    assert graph_process._state(own) == "R" and graph_process._state(missing) == "Z"
    assert graph_process._session_of(missing) == -1 and graph_process._command_line(missing) == []
    assert "python" in graph_process._command_line(own)[0]
    graph_process._signal(missing, signal.SIGTERM)
    monkeypatch.setattr(graph_process, "_state", lambda pid: "S")
    for error in (ProcessLookupError, PermissionError):

        def refuse(pid: int, error: type[OSError] = error) -> int:
            raise error

        monkeypatch.setattr(graph_process.os, "getsid", refuse)
        assert graph_process._session_of(own) == -1
