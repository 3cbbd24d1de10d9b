"""Faults of the arm at its own protocol: what the driver says, how the arm stops, and how one goes on.

A franky-sim server whose modes after a fault are the real one's, the driver as a process, and a client. Each fault
comes in mid-motion where that makes sense; the table goes to out/franky_faults.json.
"""

from __future__ import annotations

import json
import re
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("franky", reason="needs franky: make setup EXTRAS='all driver'")
pytest.importorskip("franky_sim", reason="needs franky-sim: make setup EXTRAS='all driver'")

from franky_bench import FR3, ArmUser, Processes, TableArm
from franky_table_server import read_log
from hardware_times import ROOT
from ros_domain import next_domain

from cliport_core import topics
from panda_driver.conformance.node_client import ArmClient, SentGoal
from panda_driver.conformance.plan import small_motion
from panda_driver.conformance.subject import Bounds, End
from panda_executor.model import PandaModel

OUT = ROOT / "out" / "franky_faults.json"
WAIT = 120.0  # after which a test gives up [s]
STILL = 0.005  # rad/s, in the mean of
SPAN = 50  # ticks
RECOVER, HOME = "/panda_driver/recover_errors", "/panda_driver/home_gripper"

pytestmark = pytest.mark.soak


class Bench:
    """Server, driver and client of one test."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.log_path, self.domain = folder / "ticks.bin", next_domain()
        self.processes = Processes(folder, self.domain)
        self.arm = TableArm(self.processes, "--log", str(self.log_path), *options)
        self.driver = self.start_driver("driver")
        self.user = ArmUser(self.domain)
        self.client = ArmClient(self.user.node, FR3, Bounds())

    def start_driver(self, name: str, **more: object) -> Any:
        given: dict[str, object] = {"robot_ip": self.arm.address, "arm": "fr3", "realtime": False}
        given |= {"publish_clock": True, "use_sim_time": True, **more}
        return self.processes.node(name, "panda_driver.node", **given)

    def ready(self) -> None:
        missing = self.client.missing(WAIT, with_hand=True)
        assert not missing, (missing, self.processes.log("driver"))

    def move(self, duration: float = 1.0) -> SentGoal:
        start = self.client.samples(0.0)[-1].arm
        return self.client.follow(FR3.arm_joints, small_motion(start, FR3.limits, 0.3, duration))

    def under_way(self) -> SentGoal:
        """Begin a long motion, and wait until the arm moves."""
        start = self.client.samples(0.0)[-1].arm
        goal = self.move(6.0)
        far = lambda: float(np.abs(self.client.samples(0.0)[-1].arm - start).max()) > 0.05  # noqa: E731
        assert self.client.wait(lambda: far() or goal.end is not None, WAIT)
        assert goal.end is None, goal.words
        return goal

    def ended(self, goal: SentGoal) -> str:
        assert self.client.wait(lambda: goal.end is not None, WAIT), self.processes.log("driver")
        return goal.words

    def moves_again(self) -> None:
        goal = self.move(3.0)
        self.ended(goal)
        assert goal.end is End.SUCCEEDED, goal.words

    def exit_line(self, process: Any, name: str) -> str:
        """Wait for a process that gives up by itself; return the line that it leaves."""
        assert process.wait(WAIT) == 1
        text = self.processes.log(name)
        assert "Traceback" not in text, text
        return text.strip().splitlines()[-1]

    def stopping(self) -> tuple[float, float]:
        """Return how long [s] and how far [m, TCP] the arm moved on after the mark, by the server's log."""
        self.user.wait(lambda: bool(_rests_after_mark(self.log_path)), WAIT)
        return _rests_after_mark(self.log_path)[0]

    def close(self) -> None:
        self.user.close()
        self.processes.close()


def _rests_after_mark(path: Path) -> list[tuple[float, float]]:
    """Return the way from the log's last mark to standstill, or nothing while there is none."""
    log = read_log(path)
    since = np.flatnonzero(log["mark"] == log["mark"].max())
    positions = np.stack([log[f"q{joint}"][since] for joint in range(7)], axis=1)
    if len(positions) < SPAN:
        return []
    # by positions: the simulated arm's own controller has joint 7 hum by 0.08 rad/s from one tick to the next
    spans = np.ptp(np.lib.stride_tricks.sliding_window_view(positions, SPAN, axis=0), axis=2).max(axis=1)
    quiet = np.flatnonzero(spans < STILL * SPAN / 1000.0)
    if not quiet.size:
        return []
    places = positions[[0, quiet[0]]]
    model = PandaModel(FR3)
    begin, end = (model.tcp_arrays(place)[1] for place in places)
    return [(float(log["time"][since[quiet[0]]] - log["time"][since[0]]), float(np.linalg.norm(end - begin)))]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    made.ready()
    yield made
    made.close()


def note(fault: str, words: str, recovery: str, stop: tuple[float, float] | None = None) -> None:
    """Write a row of the table."""
    OUT.parent.mkdir(exist_ok=True)
    rows = json.loads(OUT.read_text()) if OUT.is_file() else {}
    rows[fault] = {"words": words, "recovery": recovery}
    if stop is not None:
        rows[fault] |= {"stop_s": round(stop[0], 3), "stop_mm": round(1e3 * stop[1], 1)}
    OUT.write_text(json.dumps(rows, indent=1))


@pytest.mark.parametrize(
    ("fault", "said"),
    [("reflex", "cartesian_reflex"), ("exception", "communication_constraints_violation"), ("cut", "communication")],
)
def test_an_arm_that_stops_itself_goes_on_after_a_recovery(bench: Bench, fault: str, said: str) -> None:
    goal = bench.under_way()
    bench.arm.ask("mark")
    bench.arm.ask(fault)
    words = bench.ended(goal)
    assert goal.end is End.ABORTED and said in words and "recover_errors" in words
    stop = bench.stopping()
    refused = bench.move()
    bench.ended(refused)
    assert refused.end is End.REJECTED
    bench.arm.ask("mark")
    assert bench.user.trigger(RECOVER) == "the errors are cleared"
    bench.arm.ask("clear")
    bench.moves_again()
    note(fault, words, "recover_errors", stop)


def test_a_tenth_of_the_packets_lost_is_no_fault(bench: Bench) -> None:
    bench.arm.ask("drop")
    bench.moves_again()
    note("a tenth of the packets lost", "", "none needed")


def test_a_user_stop_holds_until_it_is_released(bench: Bench) -> None:
    goal = bench.under_way()
    bench.arm.ask("mark")
    bench.arm.ask("user_stop")
    words = bench.ended(goal)
    stop = bench.stopping()
    assert goal.end is End.ABORTED
    assert "stop" in bench.user.trigger(RECOVER) or "errors" in bench.user.trigger(RECOVER)
    refused = bench.move()
    bench.ended(refused)
    assert refused.end is End.REJECTED
    assert "the user stop is pressed: release it" in bench.processes.log("driver")
    bench.arm.ask("release")
    bench.user.wait(lambda: bench.user.trigger(RECOVER) == "the errors are cleared", WAIT)
    bench.moves_again()
    note("user stop", words, "release it, recover_errors", stop)


def test_a_server_that_is_gone_ends_the_driver_in_one_line(bench: Bench) -> None:
    goal = bench.under_way()
    bench.arm.process.kill()
    line = bench.exit_line(bench.driver, "driver")
    assert re.search(r"the arm at 127\S+ was lost .*start the driver again", line), line
    bench.ended(goal)
    assert goal.end is End.ABORTED
    note("server gone", line, "start the driver again")


def test_a_driver_that_is_killed_leaves_an_arm_at_rest(bench: Bench) -> None:
    bench.under_way()
    bench.arm.ask("mark")
    bench.driver.send_signal(signal.SIGKILL)
    stop = bench.stopping()
    assert stop[0] < 1.0 and stop[1] < 0.05, stop
    bench.start_driver("driver2")
    bench.user.wait(lambda: "driving the fr3" in bench.processes.log("driver2"), WAIT)
    heard = len(bench.user.joints)
    alone = lambda: bench.user.node.count_publishers(topics.JOINT_STATES) == 1  # noqa: E731
    bench.user.wait(lambda: len(bench.user.joints) > heard and alone(), WAIT)  # the killed one is forgotten
    bench.ready()
    bench.moves_again()
    note("driver killed", "", "start the driver again", stop)


def test_a_second_client_is_told_so(bench: Bench) -> None:
    second = bench.start_driver("second", connect_timeout=3.0, publish_clock=False)
    line = bench.exit_line(second, "second")
    assert re.search(r"no answer from the arm at 127\S+ for 3 s: another program may be connected", line), line
    bench.moves_again()
    note("second client", line, "end the other program")


def test_a_hand_that_is_gone_leaves_the_arm_driven(bench: Bench) -> None:
    bench.user.wait(lambda: len(bench.user.joints[-1][2]) == 9, WAIT)
    bench.arm.ask("hand_gone")
    bench.user.wait(lambda: len(bench.user.joints[-1][2]) == 7, WAIT)
    bench.moves_again()
    grip = bench.client.grip(0.01, 20.0)
    bench.ended(grip)
    assert grip.end is End.REJECTED
    line = next(line for line in bench.processes.log("driver").splitlines() if "was lost" in line)
    bench.arm.ask("hand_back")
    bench.user.wait(lambda: bench.user.trigger(HOME) == "the hand knows its range", WAIT)
    bench.user.wait(lambda: len(bench.user.joints[-1][2]) == 9, WAIT)
    note("gripper gone", line, "home_gripper")


def test_a_hand_that_was_never_homed_says_so(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "--unhomed")
    bench.ready()
    grip = bench.client.grip(0.01, 20.0)
    bench.ended(grip)
    assert grip.end is End.REJECTED
    line = next(line for line in bench.processes.log("driver").splitlines() if "does not know its range" in line)
    assert bench.user.trigger(HOME) == "the hand knows its range"
    grip = bench.client.grip(0.01, 20.0)
    bench.ended(grip)
    bench.close()
    assert grip.end is End.SUCCEEDED
    note("gripper not homed", line, "home_gripper")


def test_another_version_of_the_protocol_is_named(tmp_path: Path) -> None:
    bench = Bench(tmp_path, "--old-version")
    line = bench.exit_line(bench.driver, "driver")
    bench.close()
    assert "speaks another version of the protocol" in line, line
    note("another version", line, "another libfranka, or a newer system version")
