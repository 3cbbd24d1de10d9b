"""A camera that is bumped while the graph runs: said in words within 5 s, and no goal is taken, 10 of 10.

`make soak PYTEST_ARGS=tests/test_bumped_camera.py` runs this, some three minutes.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph_probe import STILL, GraphProbe
from ros_domain import next_domain
from rosgraph_msgs.msg import Clock

from cliport_benchmark.graph_process import GraphProcess
from cliport_core import topics
from cliport_core.messages import stamp_from_msg
from cliport_interfaces.action import PickPlace

pytestmark = [pytest.mark.soak, pytest.mark.timeout(900)]

SHIFT, TURN = 0.01, math.radians(1.0)  # of a bump [m], [rad]
NOTICED_WITHIN_S = 5.0  # of the graph's time
SETTLED_S = 3.0  # of the graph's time, after which perception knows where the table lay at first
MOVED = "the camera was moved: "
FRESH = "camera data is fresh"
RANDOM = 10  # bumps in any direction
AT_REST = (0.0,) * 6
HAND_PLACES = ((0.45, 0.1, 0.3), (0.5, -0.1, 0.25))


class Report(NamedTuple):
    """What perception said of the camera, and when [s]."""

    stamp: float
    is_error: bool
    words: str


class CameraProbe(GraphProbe):
    """A probe that also hears the graph's clock and perception's reports."""

    def __init__(self, domain_id: int) -> None:
        super().__init__(domain_id)
        self.now, self.sentence = 0.0, ""
        self.reports: list[Report] = []
        self._node.create_subscription(Clock, topics.CLOCK, self._on_clock, 10)
        self._node.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._on_diagnostics, 50)

    def first_report(self, since: float, wanted: Callable[[Report], bool], patience: float = 60.0) -> Report:
        """Return the first report after a time of the graph [s] that is as wanted."""
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            for report in list(self.reports):
                if report.stamp > since and wanted(report):
                    return report
            time.sleep(0.02)
        raise AssertionError(f"nothing of the kind was said; the last was {self.reports[-1:]}")

    def _on_clock(self, message: Clock) -> None:
        self.now = stamp_from_msg(message.clock) * 1e-9

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == topics.CAMERA_STATUS:
                stamp = stamp_from_msg(message.header.stamp) * 1e-9
                self.reports.append(Report(stamp, status.level == DiagnosticStatus.ERROR, status.message))


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CameraProbe]:
    """The client of one graph, the arm's hand over the table."""
    folder: Path = tmp_path_factory.mktemp("bumped")
    domain = next_domain()
    scene = {"task": "put-blocks-in-bowls-seen-colors"}
    with (
        GraphProcess("sim.launch.yaml", scene, folder / "graph.log", {"ROS_DOMAIN_ID": str(domain)}) as graph,
        CameraProbe(domain) as client,
    ):
        client.wait_ready(120.0, lambda: graph.alive)
        client.sentence = client.reset(**scene, split="test", seed=1)
        client.first_report(client.now + SETTLED_S, lambda report: report.words == FRESH)
        yield client
        assert "Traceback" not in graph.log_text(), graph.log_tail(60)


def bump(seed: int) -> list[float]:
    """Draw a bump: its shift [m] and the rotation vector [rad] of its turn, each in any direction alike.

    From `RANDOM` on it is along the table and about the vertical, which leaves the table's plane where it is.
    """
    drawn = np.random.default_rng((14, seed)).normal(size=(2, 3))
    if seed >= RANDOM:
        drawn *= ((1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    direction, axis = (v / np.linalg.norm(v) for v in drawn)
    return [*(SHIFT * direction), *(TURN * axis)]


@pytest.mark.parametrize("seed", range(RANDOM + 4))
def test_a_bump_is_said_in_words_and_no_goal_is_taken(probe: CameraProbe, seed: int) -> None:
    """In every other one the arm moves meanwhile, in the camera's view."""
    probe.set_sim_parameter("bump_camera", AT_REST)
    probe.first_report(probe.now + 1.0, lambda report: report.words == FRESH)
    moving = seed % 2 == 1
    if moving:
        motion = probe.send_hand(*HAND_PLACES[seed // 2 % 2])
        probe.wait_moving()
    bumped_at = probe.now
    probe.set_sim_parameter("bump_camera", bump(seed))
    said = probe.first_report(bumped_at, lambda report: report.is_error)
    assert said.words.startswith(MOVED), said.words
    assert said.stamp - bumped_at <= NOTICED_WITHIN_S
    if moving:
        ended = probe.result_of(motion)
        assert ended.outcome == PickPlace.Result.OUTCOME_SUCCEEDED, ended.message
    start = probe.wait_still(time.monotonic())
    refused = probe.result_of(probe.send_pick_place((0.42, 0.0), (0.5, 0.2)))
    assert refused.outcome == PickPlace.Result.OUTCOME_REJECTED
    assert refused.message.startswith(f"perception refuses the camera's data: {MOVED}"), refused.message
    assert "\n" not in refused.message
    ended = probe.instruct_and_wait(probe.sentence, 60.0)
    assert not ended.succeeded and MOVED in ended.message and "\n" not in ended.message, ended.message
    assert probe.fastest(start) < STILL
    print(f"bump {seed}: said after {said.stamp - bumped_at:.1f} s of the graph's time: {said.words}")
