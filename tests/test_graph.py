"""The whole graph, end to end: real processes, real DDS, real physics. Each fault ends in one clear line."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import numpy as np
import pytest
from graph_probe import STILL, GraphProbe
from hardware_times import with_hardware_times
from made_anew import MadeAnew
from ros2cli_small.launch_file import LaunchDescription
from ros_domain import next_domain
from sim_settings import with_slower_rates

from cliport_benchmark.graph_process import GraphProcess
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import PolicyStatus

TASK = "put-blocks-in-bowls-seen-colors"
SPEED = 2.0  # simulated seconds a second
POLICY_LAUNCH = Path(__file__).resolve().parents[1] / "src/cliport_bringup/launch/policy.launch.yaml"
A_SCENE = 5  # trajectories at least that an instruction sends
FAILED, DONE, EXECUTING = PolicyStatus.STATE_FAILED, PolicyStatus.STATE_DONE, PolicyStatus.STATE_EXECUTING


Running = tuple[GraphProcess, GraphProbe, Path]


@contextmanager
def graph_in(folder: Path, **arguments: str) -> Iterator[Running]:
    """Run a graph with these launch arguments; yield it, its client, and the log of what the controller was sent."""
    domain = next_domain()
    log = folder / "trajectories.jsonl"
    log.touch()
    scene = {"task": TASK, "split": "test", "seed": "1", "trajectory_log": str(log)}
    environment = {"ROS_DOMAIN_ID": str(domain)}
    with (
        GraphProcess("sim.launch.yaml", {**scene, **arguments}, folder / "graph.log", environment) as graph,
        GraphProbe(domain) as probe,
    ):
        try:
            probe.wait_ready(90.0, lambda: graph.alive)
        except Exception as error:
            raise AssertionError(f"{error}\n{graph.log_tail(40)}") from error
        assert graph.healthy, graph.log_tail(40)
        yield graph, probe, log
        assert "Traceback" not in graph.log_text(), graph.log_tail(60)
    assert graph.pids() == []


def hurried_graph(folder: Path) -> AbstractContextManager[Running]:
    """A graph whose time runs faster, while its pictures, clock and joint states come as often as at real time."""
    return graph_in(folder, params=str(with_slower_rates(folder, SPEED)), real_time_factor=str(SPEED))


@pytest.fixture(scope="module")
def graphs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MadeAnew[Running]]:
    with MadeAnew(lambda: hurried_graph(tmp_path_factory.mktemp("graph"))) as made:
        yield made


@pytest.fixture
def running(graphs: MadeAnew[Running], request: pytest.FixtureRequest) -> Running:
    """One graph for the tests of this module, with its client and its log."""
    return graphs.of(request)


@pytest.fixture
def at_rest(running: Running) -> GraphProbe:
    """The client, while the arm is at rest; it is for what changes nothing in the scene."""
    graph, client, _ = running
    assert graph.alive, graph.log_tail(40)
    client.instruct("")
    client.wait_still(time.monotonic(), 15.0)
    return client


@pytest.fixture
def probe(at_rest: GraphProbe) -> Iterator[GraphProbe]:
    """The client, with a fresh scene and every fault switched off; the arm is at rest before and after."""
    client = at_rest
    client.reset(TASK, "test", 1)
    time.sleep(0.5)
    yield client
    for fault in ("freeze_camera", "depth_all_nan", "abort_next_trajectory"):
        client.set_sim_parameter(fault, False)
    client.instruct("")


def _fails_in_one_line(probe: GraphProbe, instruction: str, timeout: float = 30.0) -> str:
    ended = probe.instruct_and_wait(instruction, timeout)
    assert not ended.succeeded
    assert ended.message and "\n" not in ended.message and len(ended.message) < 400
    return ended.message


def _holds_on_the_way(probe: GraphProbe, log: Path, sent: int) -> None:
    """The arm comes to rest far from the end of the first motion after `sent` others, and no other is sent."""
    stopped = probe.wait_still(time.monotonic())
    time.sleep(1.0)
    assert probe.fastest(stopped) < STILL
    trajectories = [json.loads(line) for line in log.read_text().splitlines()[sent:]]
    assert len(trajectories) == 1
    here = probe.positions(trajectories[0]["joint_names"])
    assert np.abs(here - trajectories[0]["positions"][-1]).max() > 0.05


# first, before the graph that the others share takes its part of the cores


def test_killing_the_executor_stops_the_arm_and_is_said(tmp_path: Path) -> None:
    """In a graph of its own, watched with the times of hardware: the simulator's are longer than a motion."""
    with graph_in(tmp_path, params=str(with_hardware_times(tmp_path, patient=True))) as (graph, probe, log):
        sentence, executor = probe.reset(TASK, "test", 3), graph.pid_of("executor")
        time.sleep(0.5)
        probe.instruct(sentence)
        probe.wait_moving(60.0)
        os.kill(executor, signal.SIGKILL)
        _holds_on_the_way(probe, log, 0)
        status = probe.wait_status(lambda s: s.state == FAILED, 30.0)
        assert "executor" in status.message and "\n" not in status.message


def test_a_corrupt_checkpoint_is_one_line(tmp_path: Path) -> None:
    """The policy server alone, started as the launch file starts it."""
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"not a checkpoint")
    (tmp_path / "broken.json").write_text("{")
    launch = LaunchDescription({"checkpoint": str(broken)})
    launch.load(POLICY_LAUNCH)
    (server,) = (process for process in launch.processes if process.label == "server")
    assert {"checkpoint": str(broken)} in server.parameters
    command = [*server.command, "-p", f"checkpoint:={broken}"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(next_domain())}
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)
    said = ended.stdout + ended.stderr
    assert ended.returncode == 1 and [line for line in said.splitlines() if "error:" in line and "broken" in line]
    assert "Traceback" not in said


def test_an_instruction_is_done(probe: GraphProbe) -> None:
    sentence = probe.reset(TASK, "test", 3)
    ended = probe.instruct_and_wait(sentence, 120.0)
    assert ended.succeeded, ended.message
    time.sleep(0.5)
    assert probe.score() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("instruction", "reason"),
    [
        ("x" * 1_000_000, "characters"),
        ("colourless ideas sleep furiously", "unlike anything"),
        ("asdf qwer zxcv", "unlike anything"),
        ("\n\t\u2603 \U0001f600", "unlike anything"),
    ],
    ids=["huge", "nonsense", "noise", "unprintable"],
)
def test_a_bad_instruction_moves_nothing(at_rest: GraphProbe, instruction: str, reason: str) -> None:
    start = time.monotonic()
    assert reason in _fails_in_one_line(at_rest, instruction)
    time.sleep(0.5)
    assert at_rest.fastest(start) < STILL


def test_an_empty_instruction_stops(running: Running, probe: GraphProbe) -> None:
    sentence = probe.reset(TASK, "test", 3)
    sent = len(running[2].read_text().splitlines())
    probe.instruct(sentence)
    probe.wait_moving()
    probe.instruct("")
    _holds_on_the_way(probe, running[2], sent)


@pytest.mark.parametrize(
    ("pick", "place"), [((0.9, 0.0), (0.4, 0.2)), ((0.4, 0.0), (0.4, 0.7)), ((float("nan"), 0.0), (0.4, 0.2))]
)
def test_a_pose_out_of_bounds_is_refused(
    at_rest: GraphProbe, pick: tuple[float, float], place: tuple[float, float]
) -> None:
    start = time.monotonic()
    result = at_rest.result_of(at_rest.send_pick_place(pick, place))
    assert result.outcome == PickPlace.Result.OUTCOME_REJECTED
    assert result.message and "\n" not in result.message
    assert at_rest.fastest(start) < STILL


def test_the_hand_goes_where_it_is_told_and_back(probe: GraphProbe) -> None:
    """The arm is in the camera's view from the second motion on."""
    for x, y, z in ((0.45, 0.1, 0.25), (0.5, -0.1, 0.2)):
        result = probe.result_of(probe.send_hand(x, y, z))
        assert result.outcome == PickPlace.Result.OUTCOME_SUCCEEDED, result.message
    low = probe.result_of(probe.send_hand(0.5, -0.1, -0.05))
    assert low.outcome == PickPlace.Result.OUTCOME_PLANNING_FAILED
    start = time.monotonic()
    planned = probe.result_of(probe.send_hand(0.45, 0.1, 0.25, plan_only=True))
    assert planned.outcome == PickPlace.Result.OUTCOME_PLANNED, planned.message
    assert probe.fastest(start) < STILL
    probe.trigger("/panda_executor/ready")
    probe.wait_moving()
    probe.wait_still(time.monotonic())


def test_nothing_to_grasp_is_said(probe: GraphProbe) -> None:
    start = time.monotonic()
    result = probe.result_of(probe.send_pick_place((0.26, -0.39), (0.4, 0.2)))
    assert result.outcome != PickPlace.Result.OUTCOME_SUCCEEDED
    assert result.message and "\n" not in result.message
    assert probe.fastest(start) < STILL


@pytest.mark.parametrize("fault", ["freeze_camera", "depth_all_nan"])
def test_a_blind_camera_moves_nothing(probe: GraphProbe, fault: str) -> None:
    sentence = probe.reset(TASK, "test", 3)
    probe.set_sim_parameter(fault, True)
    time.sleep(2.0)
    start = time.monotonic()
    message = _fails_in_one_line(probe, sentence)
    assert "heightmap" in message
    assert probe.fastest(start) < STILL


def test_a_controller_that_aborts_is_said(probe: GraphProbe) -> None:
    sentence = probe.reset(TASK, "test", 3)
    probe.set_sim_parameter("abort_next_trajectory", True)
    _fails_in_one_line(probe, sentence, 60.0)
    stopped = probe.wait_still(time.monotonic())
    time.sleep(0.5)
    assert probe.fastest(stopped) < STILL


def test_cancel_in_motion_holds_the_arm(running: Running, probe: GraphProbe) -> None:
    log = running[2]
    sentence = probe.reset(TASK, "test", 3)
    sent = len(log.read_text().splitlines())
    probe.instruct(sentence)
    probe.wait_moving()
    probe.trigger("/cliport/stop")
    _holds_on_the_way(probe, log, sent)
    message = _fails_in_one_line(probe, sentence)  # the stop is latching
    assert "resume" in message
    probe.trigger("/cliport/resume")


def test_every_trajectory_sent_is_valid_when_checked_again(
    graphs: MadeAnew[Running], running: Running, at_rest: GraphProbe
) -> None:
    from recheck import recheck_trajectory

    log = running[2]
    if len(log.read_text().splitlines()) < A_SCENE:  # the tests before may have sent enough
        at_rest.instruct_and_wait(at_rest.reset(TASK, "test", 5), 120.0)
    lines = log.read_text().splitlines()
    assert len(lines) >= A_SCENE
    graphs.end()  # which would take a core until all is checked
    for line in lines:
        recheck_trajectory(json.loads(line))
