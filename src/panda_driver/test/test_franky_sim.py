"""The driver's ports and loops on a simulator of the arm's own protocol."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fake_franka import ARM

pytest.importorskip("franky", reason="needs franky: make setup EXTRAS='all driver'")
pytest.importorskip("franky_sim", reason="needs franky-sim: make setup EXTRAS='all driver'")

from panda_driver.arm_loop import ArmLoop
from panda_driver.conformance.plan import MotionPlan, deviation, small_motion
from panda_driver.errors import ConnectionFailedError
from panda_driver.franky_ports import ArmSettings, FrankyArm, FrankyHand
from panda_driver.hand import Hand
from panda_driver.ports import ArmState
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import GripperGoal
from sim_bridge.control.trajectory_goal import TrajectoryGoal

_POST_WIDTH = 0.024  # in franky_sim_server.py [m]
_PATIENCE = 120.0  # the simulator may take ten times the time that passes in it [s]
_SETTINGS = ArmSettings(realtime=False)


@pytest.fixture
def server() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address and process of a simulated arm."""
    command = [sys.executable, str(Path(__file__).with_name("franky_sim_server.py"))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("address "):
                break
        yield line.split()[1], process
        process.kill()


class Bench:
    """An arm's loop on the simulator, in its thread."""

    def __init__(self, address: str) -> None:
        self.states, self.failures = list[ArmState](), list[BaseException]()
        arm = FrankyArm(address, _SETTINGS)
        self.loop = ArmLoop(arm, ArmControllerConfig.for_arm(ARM), self.states.append, self.failures.append)
        self.loop.start_thread()

    def small(self, duration: float = 1.0) -> MotionPlan:
        return small_motion(self.loop.state.positions, ARM.limits, 0.1, duration)


def wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came"
        time.sleep(0.01)


def goal_of(plan: MotionPlan) -> TrajectoryGoal:
    return TrajectoryGoal.from_arrays(ARM.arm_joints, plan.times, plan.positions, plan.velocities)


def test_a_motion_is_followed_and_a_second_braked(server: tuple[str, subprocess.Popen[str]]) -> None:
    bench = Bench(server[0])
    plan, begin = bench.small(), bench.loop.state.time
    execution = bench.loop.start(goal_of(plan))
    wait(lambda: execution.done)
    assert (execution.status, execution.error_string) == (GoalStatus.SUCCEEDED, "")
    took = bench.loop.state.time - begin
    assert took == pytest.approx(1.0, abs=0.3)
    assert deviation(plan, [state.positions for state in bench.states[::5]]) < 0.01
    begin_at = bench.loop.state.positions
    execution = bench.loop.start(goal_of(bench.small()))
    wait(lambda: execution.done or float(np.abs(bench.loop.state.positions - begin_at).max()) > 0.03)
    assert not execution.done, execution.error_string
    bench.loop.cancel(execution)
    wait(lambda: execution.done)
    assert execution.status is GoalStatus.CANCELED
    assert float(np.abs(bench.loop.state.positions - begin_at).max()) < 0.09
    bench.loop.recover(_PATIENCE)
    bench.loop.stop_thread()
    assert not bench.failures


def test_closing_on_the_post_is_a_grasp(server: tuple[str, subprocess.Popen[str]]) -> None:
    hand = Hand(lambda: FrankyHand(server[0]), ARM.hand, lambda _: None)
    hand.start_thread()
    status, result, words = hand.execute(GripperGoal(0.0, 20.0))
    assert (status, result.stalled, result.reached_goal) == (GoalStatus.SUCCEEDED, True, False), words
    assert result.width == pytest.approx(_POST_WIDTH, abs=0.004)
    status, result, words = hand.execute(GripperGoal(0.035))
    assert (status, result.stalled) == (GoalStatus.SUCCEEDED, False), words
    hand.stop_thread()


def test_a_server_that_goes_away_ends_the_loop_in_words(server: tuple[str, subprocess.Popen[str]]) -> None:
    address, process = server
    bench = Bench(address)
    execution = bench.loop.start(goal_of(bench.small(3.0)))
    wait(lambda: len(bench.states) > 50)
    process.kill()
    wait(lambda: bool(bench.failures) or bool(bench.loop.state.fault))
    wait(lambda: execution.done)
    assert execution.status is GoalStatus.ABORTED
    assert execution.error_string


def test_where_no_arm_is_one_line_says_so() -> None:
    with pytest.raises(ConnectionFailedError, match=r"no arm at 127\.0\.0\.99 .*FCI is active in Desk"):
        FrankyArm("127.0.0.99", _SETTINGS)
    with pytest.raises(ConnectionFailedError, match=r"no hand at 127\.0\.0\.99 .*gripper:=false"):
        FrankyHand("127.0.0.99")
