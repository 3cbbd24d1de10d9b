"""What a simulation loop does with calls that it cannot serve in time."""

import threading
from types import SimpleNamespace
from typing import Any

import pytest
from played_faults import played_faults

from cliport_core.pose import Pose
from sim_bridge.errors import SimulationError
from sim_bridge.node_parameters import SimParameters
from sim_bridge.node_state import StatePublisher
from sim_bridge.pacing import RealTimePacer
from sim_bridge.sim_loop import SimLoop


def make_loop() -> SimLoop:
    """A loop without steps: its pacer never finds one due."""
    controller = SimpleNamespace(reset=lambda reason: None)
    return SimLoop(SimpleNamespace(), controller, controller, RealTimePacer(1e6))  # type: ignore[arg-type]


def test_a_call_that_is_given_up_is_never_carried_out() -> None:
    loop, done = make_loop(), list[str]()
    with pytest.raises(SimulationError, match=r"was busy for 0.05 s and has not done this: ask again"):
        loop.call(lambda: done.append("late"), timeout=0.05)  # the loop does not run yet, as in a long reset
    loop.start()
    loop.call(lambda: done.append("next"))
    loop.stop()
    assert done == ["next"]


def test_a_call_that_takes_too_long_is_said_to_go_on() -> None:
    loop, may_end, ended = make_loop(), threading.Event(), threading.Event()

    def job() -> None:
        may_end.wait(10.0)
        ended.set()

    loop.start()
    with pytest.raises(SimulationError, match=r"still does this after 0.05 s"):
        loop.call(job, timeout=0.05)
    may_end.set()
    assert ended.wait(10.0)
    loop.stop()


def test_clock_and_joints_are_said_at_their_own_rates() -> None:
    periods: dict[str, float] = {}
    loop: Any = SimpleNamespace(every=lambda period, call: periods.update({call.__name__: period}))
    node: Any = SimpleNamespace(create_publisher=lambda *_: SimpleNamespace(publish=lambda _: None))
    camera: Any = SimpleNamespace(camera_in_base=Pose.from_xyz_rpy((0.4, 0.0, 1.0), (0.0, 0.0, 0.0)))
    StatePublisher(node, loop, camera, SimParameters(clock_rate=100.0, joint_state_rate=40.0), played_faults())
    assert periods == {"_publish_clock": 0.01, "_publish_joints": 0.025}


def test_a_loop_that_has_ended_says_so() -> None:
    loop = make_loop()
    loop.start()
    loop.stop()
    with pytest.raises(SimulationError, match="the simulation has stopped"):
        loop.call(lambda: None)
