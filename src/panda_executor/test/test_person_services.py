"""The services for a person: what they answer before the arm moves, and what it avoids then."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ros_clouds import raw_cloud
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import Pose
from panda_executor.approvals import Approvals
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.gate import Gate
from panda_executor.node_services import PersonServices
from panda_executor.surroundings import Surroundings

S = 1_000_000_000
MOVES = [topics.EXECUTOR_READY, topics.EXECUTOR_RECOVER]


class Bench:
    """The services over a node, a runner and a planner that are played; the time is 10 s."""

    def __init__(self) -> None:
        self.services: dict[str, Callable[[Any, Any], Any]] = {}
        self.camera, self.clouds = CameraPlace("panda_link0"), CloudCache()
        self.placed: list[np.ndarray] = []
        self.seen: list[np.ndarray | None] = []
        self.ended = threading.Event()
        surroundings = Surroundings(self, self.clouds, self.camera, "panda_link0", lambda: 10 * S)  # type: ignore[arg-type]
        group: Any = None
        PersonServices(self, Gate(), self, Approvals(1.0), lambda: None, surroundings, group)  # type: ignore[arg-type]

    def create_service(self, _: Any, name: str, callback: Callable[[Any, Any], Any], callback_group: Any) -> None:
        self.services[name] = callback

    def get_logger(self) -> logging.Logger:
        return logging.getLogger("test")

    def place_cameras(self, position: np.ndarray) -> None:
        self.placed.append(position)

    def go_ready(self, should_stop: Callable[[], bool], cloud: np.ndarray | None) -> ActionResult:
        self.seen.append(cloud)
        self.ended.set()
        return ActionResult(Outcome.SUCCEEDED, "at its ready pose")

    recover = go_ready

    def open(self, should_stop: Callable[[], bool]) -> ActionResult:
        self.ended.set()
        return ActionResult(Outcome.SUCCEEDED, "open")

    def call(self, name: str) -> tuple[bool, str]:
        response = self.services[name](Trigger.Request(), Trigger.Response())
        return bool(response.success), str(response.message)

    def calibrate(self) -> None:
        self.camera.put("panda_link0", "camera", Pose(np.eye(3), np.array([0.9, 0.0, 0.8])))
        self.camera.see("camera")


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.mark.parametrize("name", MOVES)
def test_nothing_moves_while_nobody_knows_where_the_camera_stands(bench: Bench, name: str) -> None:
    answer = bench.call(name)
    assert answer == (False, "where the camera stands is not known: no camera_info has arrived; is it running?")
    assert not bench.seen


@pytest.mark.parametrize("name", MOVES)
def test_the_camera_is_avoided_before_there_was_a_goal(bench: Bench, name: str) -> None:
    bench.calibrate()
    bench.clouds.put(raw_cloud(np.zeros((4, 3), np.float32), 10 * S))
    assert bench.call(name) == (True, "begun; the log says how it ends")
    assert bench.ended.wait(10.0)
    np.testing.assert_array_equal(bench.placed, [[0.9, 0.0, 0.8]])
    assert bench.seen[0] is not None and bench.seen[0].shape == (4, 3)


@pytest.mark.parametrize("name", MOVES)
def test_a_motion_without_a_cloud_says_so(bench: Bench, name: str) -> None:
    bench.calibrate()
    done, words = bench.call(name)
    assert done
    assert "only the arm itself, the table, the camera and its post are avoided: no point cloud has arrived" in words
    assert bench.ended.wait(10.0)
    assert bench.seen == [None]


def test_the_fingers_open_whatever_is_known(bench: Bench) -> None:
    assert bench.call(topics.EXECUTOR_OPEN)[0]
    assert bench.ended.wait(10.0)
