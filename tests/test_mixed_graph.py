"""The whole of put-blocks-in-bowls with an arm behind its own protocol: the simulator mirrors what that arm reports.

SEEDS (10) scenes with franky-sim's arm under the driver, and the same with the simulator's own arm (ARMS). What the
mirrored fingers meet is told to the arm's server, whose own fingers stop there. The scores go to out/mixed_graph.json.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("franky", reason="needs franky: make setup EXTRAS='all driver'")
pytest.importorskip("franky_sim", reason="needs franky-sim: make setup EXTRAS='all driver'")

import rclpy
from franky_bench import PATIENT, STIFFNESS, Processes, TableArm
from hardware_times import ROOT
from rclpy.qos import qos_profile_sensor_data
from ros_domain import next_domain
from sensor_msgs.msg import JointState
from sim_settings import shipped_settings, written
from std_srvs.srv import Trigger

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_process import GraphProcess
from cliport_core import topics
from cliport_core.ros_running import SpinThread
from sim_bridge.mirror import SQUEEZE

TASK = "put-blocks-in-bowls-seen-colors"
ARMS = os.environ.get("ARMS", "mixed plain").split()  # what is run; the other's scores are those of before
SEEDS = int(os.environ.get("SEEDS", "10"))
FIRST = int(os.environ.get("FIRST", "0"))
OUT = ROOT / "out" / "mixed_graph.json"
PATIENCE = 300.0  # for one instruction, wall clock [s]
POINTS = 10.0  # by which the scores may differ
MET = 0.002  # of fingers that stand wider than they would alone [m]
STILL = 0.005  # of a finger [m/s]

pytestmark = pytest.mark.soak


class Fingers:
    """Tells the arm's server what the mirrored fingers met."""

    def __init__(self, domain: int, arm: TableArm) -> None:
        self._arm, self._reported, self._between = arm, 0.0, 0.0
        self._context = rclpy.Context()
        self._context.init(domain_id=domain)
        self._node = rclpy.create_node("mirrored_fingers", context=self._context)
        qos = qos_profile_sensor_data
        self._node.create_subscription(JointState, topics.JOINT_STATES, self._on_report, qos)
        self._node.create_subscription(JointState, topics.SIM_TRUE_JOINTS, self._on_mirror, qos)
        self._spinner = SpinThread(self._node, lambda _: None, self._context)

    def close(self) -> None:
        self._spinner.stop()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _on_report(self, message: JointState) -> None:
        if len(message.position) == 9:
            self._reported = float(sum(message.position[7:]))

    def _on_mirror(self, message: JointState) -> None:
        width, speed = float(sum(message.position[7:])), max(map(abs, message.velocity[7:]))
        alone = max(self._reported - SQUEEZE, 0.0)
        if self._between and width < alone + MET:
            self._between = 0.0
        elif not self._between and speed < STILL and width > alone + MET:
            self._between = width
        else:
            return
        self._arm.ask(f"between {self._between:.5f}")


def parameters(folder: Path) -> Path:
    """Return the simulator's parameters for an FR3, with patience for a machine that simulates two arms."""
    settings = shipped_settings()
    settings["/**"]["ros__parameters"]["robot"] = "fr3"
    settings["/panda_executor"]["ros__parameters"] |= PATIENT
    return written(settings, folder)


def scores(domain: int, folder: Path, **arguments: str) -> list[float]:
    """Run the scenes in a graph with these launch arguments; return their scores."""
    scene = {"task": TASK, "split": "test", "seed": str(FIRST)}
    environment = {"ROS_DOMAIN_ID": str(domain)}
    with (
        GraphProcess("sim.launch.yaml", {**scene, **arguments}, folder / "graph.log", environment) as graph,
        GraphClient("mixed_graph", domain) as client,
    ):
        client.wait_ready(120.0, lambda: graph.alive)
        return [score(client, seed, lambda: graph.alive) for seed in range(FIRST, FIRST + SEEDS)]


def score(client: GraphClient, seed: int, alive: Callable[[], bool]) -> float:
    """Have one scene done; return its score, which a failure leaves where it was."""
    client.wait_at_rest(60.0)
    sentence = client.reset(TASK, "test", seed)
    time.sleep(1.0)
    try:
        ended = client.instruct_and_wait(sentence, PATIENCE, alive)
        words = ended.message
        if not ended.succeeded:  # so that the next scene begins with the arm out of view
            recover = client._node.create_client(Trigger, topics.EXECUTOR_RECOVER)
            words += f"; {client._call(recover, Trigger.Request(), 30.0).message}"
    except BenchmarkError as error:
        client.instruct("")
        words = str(error)
    found = client.score()
    print(f"seed {seed}: {found:.2f} {words}", flush=True)
    return found


@pytest.mark.timeout(7200)
def test_an_arm_behind_its_protocol_does_the_task_as_well(tmp_path: Path) -> None:
    found = json.loads(OUT.read_text()) if OUT.is_file() and len(ARMS) == 1 else {}
    run = {"mixed": mixed_scores, "plain": lambda folder: scores(next_domain(), folder)}
    OUT.parent.mkdir(exist_ok=True)
    for arm in ARMS:
        began = time.monotonic()
        found[arm] = run[arm](tmp_path)
        found[f"{arm}_wall_s"] = time.monotonic() - began
        OUT.write_text(json.dumps(found, indent=1))
    if missing := {"mixed", "plain"} - found.keys():
        pytest.skip(f"ran {ARMS} alone, which nothing is there to compare with: run with ARMS={' '.join(missing)} too")
    assert 100.0 * abs(np.mean(found["mixed"]) - np.mean(found["plain"])) <= POINTS, found


def mixed_scores(folder: Path) -> list[float]:
    """Run the scenes with an arm behind its own protocol; return their scores."""
    domain = next_domain()
    processes = Processes(folder, domain)
    arm = TableArm(processes, "--block", "-1.0", "1.0")
    driver = {"robot_ip": arm.address, "arm": "fr3", "realtime": False, "publish_clock": True, "use_sim_time": True}
    processes.node("driver", "panda_driver.node", heartbeat_timeout=5.0, stiffness=STIFFNESS, **driver)
    fingers = Fingers(domain, arm)
    try:
        return scores(domain, folder, mirror=topics.JOINT_STATES, params=str(parameters(folder)))
    finally:
        fingers.close()
        processes.close()
