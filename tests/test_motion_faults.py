"""Faults injected into the running graph: how long the arm moves on after each, and how far.

`make soak` runs this; the figures go to out/motion_faults.json, and `python tests/fault_table.py` makes the table of
docs/motion_safety.md of them.

Where a process died or hangs the arm is to rest DIED after it, else BRAKES after the fault is known: at once, but for
those of KNOWN_AFTER, which is added to either.
"""

import json
import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from browser_user import CHROMIUM
from fault_table import OUT, FaultLog
from graph_probe import STILL, GraphProbe
from hardware_times import with_hardware_times
from numpy.typing import NDArray
from ros_domain import next_domain

from cliport_benchmark.graph_process import GraphProcess
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import PolicyStatus
from panda_executor.model import PandaModel
from panda_model import load_preset

TASK = "put-blocks-in-bowls-seen-colors"
DIED = 0.5  # from the end or the hang of a process to the arm's rest [s]
BRAKES = 0.3  # from when a fault is known to the arm's rest [s]
KNOWN_AFTER = {  # the fault [s]
    "joint states lost": 0.3,  # the guard's joint_silence
    "joint states restamped": 0.4,  # the executor's ArmWatch.frozen
    "guard killed": 3.0,  # the executor's guard_silence
    "cancel lost, stop asked for": 0.3,  # the executor waits 0.1 s for its cancel, the simulator 0.2 s for a heartbeat
}
BUSY_LOAD = 2.0  # load average of the last minute for each core from which a machine is busy; a graph alone stays below
BUSY = 0.1  # more on such a machine [s]: with 10 to 15 on two cores the worst rows were 0.06 s above these limits
JOINTS = list(load_preset().arm_joints)
SENT = "trajectories.jsonl"  # what the arm's controller was sent
SLOW = 0.25  # velocity scaling at which a motion is far from its end when it is stopped

pytestmark = pytest.mark.soak


@contextmanager
def resting_graph(tmp_path: Path, patient: bool, **executor: float) -> Iterator[tuple[GraphProcess, GraphProbe, str]]:
    """A graph of its own for each fault, in real time, its arm at rest; and what there is to be done."""
    domain, sent = next_domain(), tmp_path / SENT
    sent.touch()
    params = str(with_hardware_times(tmp_path, patient, **executor))
    arguments = {"task": TASK, "split": "test", "seed": "3", "params": params, "trajectory_log": str(sent)}
    environment = {"ROS_DOMAIN_ID": str(domain)}
    with (
        GraphProcess("sim.launch.yaml", arguments, tmp_path / "graph.log", environment) as graph,
        GraphProbe(domain) as probe,
    ):
        probe.wait_ready(90.0, lambda: graph.alive)
        sentence = probe.reset(TASK, "test", 3)
        time.sleep(0.5)
        yield graph, probe, sentence
        assert "Traceback" not in graph.log_text(), graph.log_tail(60)


@pytest.fixture
def ready(tmp_path: Path) -> Iterator[tuple[GraphProcess, GraphProbe, str]]:
    """A graph for what does not depend on how long the executor waits for signs of life."""
    with resting_graph(tmp_path, patient=True) as graph:
        yield graph


@pytest.fixture
def moving(tmp_path: Path) -> Iterator[tuple[GraphProcess, GraphProbe]]:
    """A graph with the times of the hardware, whose arm is under way to the pick."""
    with resting_graph(tmp_path, patient=False) as (graph, probe, sentence):
        probe.instruct(sentence)
        probe.wait_moving(40.0)
        time.sleep(0.25)
        yield graph, probe


def kill(executable: str, number: int) -> Callable[[GraphProcess, GraphProbe], None]:
    return lambda graph, probe: os.kill(graph.pid_of(executable), number)


def switched(name: str) -> Callable[[GraphProcess, GraphProbe], None]:
    return lambda graph, probe: probe.set_sim_parameter(name, True)


FAULTS: dict[str, Callable[[GraphProcess, GraphProbe], object]] = {
    "executor killed": kill("executor", signal.SIGKILL),
    "executor hung (SIGSTOP)": kill("executor", signal.SIGSTOP),
    "policy server killed": kill("server", signal.SIGKILL),
    "stop asked for at the executor": lambda graph, probe: probe.trigger("/panda_executor/stop"),
    "stop asked for at the policy server": lambda graph, probe: probe.trigger("/cliport/stop"),
    "an empty instruction": lambda graph, probe: probe.instruct(""),
    "joint states lost": switched("joint_states_lost"),
    "joint states 1 s old": switched("joint_states_old"),
    "joint states 1 s ahead": switched("joint_states_ahead"),
    "joint states restamped": switched("joint_states_restamped"),
    "clock 10 s ahead": switched("clock_ahead"),
    "clock 10 s back": switched("clock_back"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_arm_comes_to_rest(moving: tuple[GraphProcess, GraphProbe], fault: str) -> None:
    graph, probe = moving
    log = FaultLog(graph.log_path)
    before, start = probe.positions(JOINTS), time.monotonic()
    FAULTS[fault](graph, probe)
    still = _rests(probe, fault, start, before, log)
    if fault.startswith("executor hung"):
        os.kill(graph.pid_of("executor"), signal.SIGCONT)
        time.sleep(1.0)  # it wakes up: nothing may go on
    time.sleep(0.5)
    assert probe.fastest(still + 0.05) < STILL, "the arm went on"


def test_a_cancel_that_is_lost_is_made_up_for_by_the_simulator(tmp_path: Path) -> None:
    """The motion is slow: what ends it has to be the simulator's own check, and not its goal."""
    with resting_graph(tmp_path, patient=False, velocity_scaling=SLOW) as (graph, probe, sentence):
        probe.instruct(sentence)
        probe.wait_moving(40.0)
        time.sleep(0.25)
        probe.set_sim_parameter("lose_cancel", True)
        log = FaultLog(graph.log_path)
        before, start = probe.positions(JOINTS), time.monotonic()
        probe.trigger("/panda_executor/stop")
        still = _rests(probe, "cancel lost, stop asked for", start, before, log)
        assert probe.fastest(still + 0.05) < STILL, "the arm went on"
        assert "heartbeat lost: nothing from the executor" in graph.log_text(), graph.log_tail(30)
        [goal] = map(json.loads, (tmp_path / SENT).read_text().splitlines())
        assert np.abs(probe.positions(goal["joint_names"]) - goal["positions"][-1]).max() > 0.05, "it had arrived"


def test_a_guard_that_is_killed_ends_the_motion_it_no_longer_watches(tmp_path: Path) -> None:
    with resting_graph(tmp_path, patient=False, velocity_scaling=0.1) as (graph, probe, sentence):
        probe.instruct(sentence)
        probe.wait_moving(40.0)
        log, before, start = FaultLog(graph.log_path), probe.positions(JOINTS), time.monotonic()
        os.kill(graph.pid_of("guard"), signal.SIGKILL)
        _rests(probe, "guard killed", start, before, log)
        assert "no guard was heard for 3 s" in graph.log_text(), graph.log_tail(30)


# switches of the simulator before the motion, and what the executor must say then
WORDS = {
    "abort_next_trajectory": "the arm's motion aborted",
    "never_accept": "no answer from",
    "never_end": "took more than",
    "miss_goal": "goal tolerance violated",
    "gripper_stalls": "the gripper",
    "gripper_misses": "closed on nothing",
}


@pytest.mark.parametrize("switch", WORDS)
def test_what_fails_is_named_and_the_arm_rests(ready: tuple[GraphProcess, GraphProbe, str], switch: str) -> None:
    graph, probe, sentence = ready
    probe.set_sim_parameter(switch, True)
    log = FaultLog(graph.log_path)
    probe.instruct(sentence)
    said = _wait_words(graph, WORDS[switch], 40.0)
    probe.instruct("")
    still = _rests(probe, switch.replace("_", " "), said, probe.positions(JOINTS), log)
    time.sleep(0.5)
    assert probe.fastest(still + 0.05) < STILL, "the arm went on"


def test_a_camera_that_freezes_on_the_way_ends_in_one_line(ready: tuple[GraphProcess, GraphProbe, str]) -> None:
    """The motions that were planned may be carried out, or not; nothing is chosen from an old picture."""
    _, probe, sentence = ready
    probe.instruct(sentence)
    probe.wait_phase("GO_ABOVE_PICK", 60.0)
    probe.wait_moving(5.0)
    probe.set_sim_parameter("freeze_camera", True)
    status = probe.wait_status(lambda said: said.state == PolicyStatus.STATE_FAILED, 60.0)
    assert status.message and "\n" not in status.message
    still = probe.wait_still(time.monotonic(), 5.0)
    time.sleep(0.5)
    assert probe.fastest(still + 0.05) < STILL, "the arm went on"


def test_what_is_dropped_on_the_way_is_noticed(ready: tuple[GraphProcess, GraphProbe, str]) -> None:
    graph, probe, sentence = ready
    probe.instruct(sentence)
    probe.wait_phase("CARRY", 60.0)
    time.sleep(0.25)
    log = FaultLog(graph.log_path)
    before, start = probe.positions(JOINTS), time.monotonic()
    probe.set_sim_parameter("gripper_drops", True)
    _rests(probe, "gripper drops", start, before, log, span=0.06)  # it is to go home then
    _wait_words(graph, "the object was lost during", 20.0)


AT_REST = ("GRASP_PLANNING", "CLOSE", "OPEN")  # phases in which the arm does not move
PHASES = ("GRASP_PLANNING", "GO_ABOVE_PICK", "DESCEND", "CLOSE", "RAISE", "CARRY", "LOWER", "OPEN", "RETREAT")


@pytest.mark.parametrize("phase", PHASES)
def test_a_stop_in_each_phase_holds_the_arm_until_it_is_asked_again(
    ready: tuple[GraphProcess, GraphProbe, str], phase: str
) -> None:
    graph, probe, sentence = ready
    probe.instruct(sentence)
    probe.wait_phase(phase, 60.0)
    if phase not in AT_REST:
        probe.wait_moving(5.0)
    log = FaultLog(graph.log_path)
    before, start = probe.positions(JOINTS), time.monotonic()
    probe.trigger("/panda_executor/stop")
    still = _rests(probe, f"stop in {phase}", start, before, log)
    probe.trigger("/panda_executor/resume")
    time.sleep(1.0)
    assert probe.fastest(still + 0.05) < STILL, "the stopped goal went on"


def test_a_simulator_that_is_killed_ends_the_goal(moving: tuple[GraphProcess, GraphProbe]) -> None:
    """Its arm goes with it: what is measured is when the executor knows."""
    graph, _ = moving
    log, start = FaultLog(graph.log_path), time.monotonic()
    os.kill(graph.pid_of("sim"), signal.SIGKILL)
    ended = _wait_words(graph, "the clock stands still", 20.0)  # the policy server may have cancelled before
    _note("simulator killed: the executor's goal ends", ended - start, 0.0, log.said())


def _wait_words(graph: GraphProcess, words: str, timeout: float) -> float:
    """Return when the graph had said some words, wall time."""
    deadline = time.monotonic() + timeout
    while words not in graph.log_text():
        assert time.monotonic() < deadline, f"not said within {timeout} s: {words}\n{graph.log_tail(30)}"
        time.sleep(0.02)
    return time.monotonic()


def _rests(
    probe: GraphProbe, fault: str, start: float, before: NDArray[np.float64], log: FaultLog, span: float = 0.3
) -> float:
    """Note how long after `start` and how far from `before` the arm comes to rest; return when, wall time."""
    still = probe.wait_still(start, 5.0, span)
    model = PandaModel()
    metres = float(np.linalg.norm(model.tcp_arrays(probe.positions(JOINTS))[1] - model.tcp_arrays(before)[1]))
    load, limit = os.getloadavg()[0], _limit(fault)
    _note(fault, still - start, metres, log.said(), limit, load)
    assert still - start <= limit, f"{fault}: {still - start:.3f} s, load average {load:.1f}"
    return still


def _limit(fault: str) -> float:
    """Return how long after a fault the arm may move [s]; longer on a machine that is busy with other things."""
    died = any(word in fault for word in ("killed", "hung"))
    busy = os.getloadavg()[0] > BUSY_LOAD * (os.cpu_count() or 1)
    return KNOWN_AFTER.get(fault, 0.0) + (DIED if died else BRAKES) + busy * BUSY


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
@pytest.mark.parametrize(("fault", "number"), [("page killed", signal.SIGKILL), ("page hung", signal.SIGSTOP)])
def test_the_arm_comes_to_rest_when_its_page_is_gone(tmp_path: Path, fault: str, number: signal.Signals) -> None:
    import page_person as teaching  # only who has a browser needs it

    params = str(with_hardware_times(tmp_path))
    with (
        teaching.workplace(tmp_path, next_domain(), 1.0, params=params) as place,
        GraphProbe(place.domain) as probe,
    ):
        probe.wait_ready(90.0, lambda: True)
        person = teaching.Person(place.browser, place.app.address)
        person.open_data_set(teaching.DATA_SET)
        teaching.lay_out(person, place.client, seed=3000)
        person.say(teaching.SENTENCE)
        person.draw_a_step()
        person.begin()
        probe.wait_moving(40.0)
        time.sleep(0.25)
        log = FaultLog(place.root / "graph.log")
        before, start = probe.positions(JOINTS), time.monotonic()
        os.kill(place.app.pid, number)
        still = _rests(probe, fault, start, before, log)
        time.sleep(0.5)
        assert probe.fastest(still + 0.05) < STILL, "the arm went on"
        os.kill(place.app.pid, signal.SIGKILL)


def test_a_goal_that_was_stopped_does_not_go_on_after_a_resume(moving: tuple[GraphProcess, GraphProbe]) -> None:
    _, probe = moving
    probe.trigger("/panda_executor/stop")
    probe.trigger("/panda_executor/resume")
    still = probe.wait_still(time.monotonic(), 5.0)
    time.sleep(1.0)
    assert probe.fastest(still + 0.05) < STILL


def test_another_client_is_refused_while_the_arm_moves(moving: tuple[GraphProcess, GraphProbe]) -> None:
    _, probe = moving
    assert not probe.send_pick_place((0.4, 0.1), (0.4, -0.2)).accepted


def test_random_goals_move_nothing_or_end_in_one_line(tmp_path: Path) -> None:
    """A thousand goals, most of them senseless, all of them only planned: outside, below the table, on their side."""
    domain = next_domain()
    environment = {"ROS_DOMAIN_ID": str(domain)}
    arguments = {"task": TASK, "split": "test", "seed": "3"}
    random = np.random.default_rng(0)
    odd = [float("nan"), float("inf"), -float("inf"), 1e30, -5.0, 0.0]
    low = [[-1.0, -1.0, -0.2, -1.0, -1.0, -1.0, -1.0]] * 2  # a position [m] and a quaternion, of pick and place
    high = [[1.0, 1.0, 0.2, 1.0, 1.0, 1.0, 1.0]] * 2
    with (
        GraphProcess("sim.launch.yaml", arguments, tmp_path / "graph.log", environment) as graph,
        GraphProbe(domain) as probe,
    ):
        probe.wait_ready(90.0, lambda: graph.alive)
        checked = time.monotonic()
        for _ in range(1000):
            poses = random.uniform(low, high)
            poses[:, 3:] *= random.choice([0.0, 0.1, 1.0, 9.0], p=[0.1, 0.3, 0.3, 0.3])
            odd_share = random.choice([0.0, 0.0, 0.15])
            poses = np.where(random.random(poses.shape) < odd_share, random.choice(odd, poses.shape), poses)
            pick, place = ((pose[:3].tolist(), pose[3:].tolist()) for pose in poses)
            result = probe.result_of(probe.send_plan(pick, place))
            assert result.outcome in (
                PickPlace.Result.OUTCOME_REJECTED,
                PickPlace.Result.OUTCOME_PLANNING_FAILED,
                PickPlace.Result.OUTCOME_PLANNED,
            )
            assert result.message and "\n" not in result.message
            now = time.monotonic()
            if now - checked > 1.0:  # more is forgotten in the end than is remembered
                assert probe.fastest(checked) < STILL
                checked = now
        time.sleep(1.0)
        assert probe.fastest(checked) < STILL
        assert graph.healthy


def _note(fault: str, seconds: float, metres: float, words: str, limit: float = math.inf, load: float = 0.0) -> None:
    OUT.parent.mkdir(exist_ok=True)
    found = json.loads(OUT.read_text()) if OUT.is_file() else {}
    found[fault] = {"standstill_s": round(seconds, 3), "way_m": round(metres, 4), "words": words}
    OUT.write_text(json.dumps(found, indent=1) + "\n")
    print(
        f"{fault}: at rest after {seconds:.3f} s (at most {limit:.2f} s, load average {load:.1f}), "
        f"{1000 * metres:.0f} mm: {words}"
    )
