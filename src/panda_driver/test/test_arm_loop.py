"""The arm's loop over an arm that does what it is told."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future

import numpy as np
import pytest
from fake_franka import ARM, FakeArm

from panda_driver import arm_loop
from panda_driver.arm_loop import HOLD_S, LATE_S, ArmLoop
from panda_driver.errors import ArmFaultError, ConnectionFailedError
from panda_driver.ports import ArmState
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.joint_trajectory_controller import GoalRejectedError, TrajectoryExecution
from sim_bridge.control.trajectory_goal import TrajectoryGoal

WAY = np.array([0.1, 0.05, 0.0, 0.05, 0.0, 0.0, 0.1])  # [rad]


class Bench:
    """A loop without its thread: the test turns it."""

    def __init__(self) -> None:
        self.arm, self.states, self.failures = FakeArm(), list[ArmState](), list[BaseException]()
        self.loop = ArmLoop(self.arm, ArmControllerConfig.for_arm(ARM), self.states.append, self.failures.append)

    def turn(self, until: Callable[[], bool], most: int = 2000) -> None:
        for _ in range(most):
            if until():
                return
            self.loop.turn()
        raise AssertionError("it never came")

    def finish(self, execution: TrajectoryExecution) -> None:
        self.turn(lambda: execution.done)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def goal(start: float = 0.0, way: float = 1.0, times: tuple[float, ...] = (0.0, 1.0, 2.0)) -> TrajectoryGoal:
    """Make a motion there, in 2 s; start: how far from the arm it begins; way: as a share of WAY."""
    rows = np.array([ARM.ready + start, ARM.ready + 0.5 * way * WAY, ARM.ready + way * WAY])
    speeds = np.array([np.zeros(7), way * WAY * 0.9, np.zeros(7)])
    return TrajectoryGoal.from_arrays(ARM.arm_joints, times, rows, speeds)


def test_a_trajectory_is_followed_in_the_arms_own_time(bench: Bench) -> None:
    begin = bench.arm.time
    execution = bench.loop.start(goal())
    bench.finish(execution)
    assert execution.status is GoalStatus.SUCCEEDED
    assert bench.arm.time - begin == pytest.approx(2.0, abs=0.1)
    np.testing.assert_allclose(bench.arm.positions, ARM.ready + WAY, atol=1e-6)
    middle = min(bench.states, key=lambda state: abs(state.time - begin - 1.0))
    np.testing.assert_allclose(middle.positions, ARM.ready + 0.5 * WAY, atol=0.005)


def test_a_loop_that_was_held_up_goes_on_where_the_path_was(bench: Bench) -> None:
    begin = bench.arm.time
    execution = bench.loop.start(goal())
    bench.turn(lambda: bench.arm.positions[0] > ARM.ready[0] + 0.04)
    before = bench.arm.positions.copy()
    bench.arm.time += 0.1
    bench.loop.turn()
    assert 0.0 < np.abs(bench.arm.positions - before).max() < 1.1 * LATE_S * np.abs(WAY).max()
    bench.finish(execution)
    assert execution.status is GoalStatus.SUCCEEDED
    assert bench.arm.time - begin == pytest.approx(2.0 + 0.1 - LATE_S + bench.arm.step, abs=0.05)
    bench.turn(lambda: not bench.arm.in_control)
    assert bench.loop.time == bench.arm.time


def test_a_loop_that_was_held_up_for_long_lets_the_arm_hold(bench: Bench) -> None:
    execution = bench.loop.start(goal())
    bench.turn(lambda: bench.arm.positions[0] > ARM.ready[0] + 0.04)
    before = bench.arm.positions.copy()
    bench.arm.time += 0.2
    bench.loop.turn()
    assert execution.status is GoalStatus.ABORTED and "held up for 0.21 s" in execution.error_string
    np.testing.assert_array_equal(bench.arm.positions, before)
    assert not bench.arm.velocities.any()


def test_control_is_taken_for_a_motion_and_given_back(bench: Bench) -> None:
    bench.loop.turn()
    assert not bench.arm.in_control
    bench.finish(bench.loop.start(goal()))
    assert bench.arm.in_control
    rests_at = bench.arm.time
    bench.turn(lambda: not bench.arm.in_control)
    assert bench.arm.time - rests_at == pytest.approx(HOLD_S, abs=0.15) and HOLD_S == 0.3
    bench.arm.positions = bench.arm.positions + 0.3  # moved by hand
    with pytest.raises(GoalRejectedError, match=r"first point is 0\.\d+ rad from"):
        bench.loop.start(goal())


def test_a_cancel_brakes_on_the_path_and_holds(bench: Bench) -> None:
    execution = bench.loop.start(goal())
    bench.turn(lambda: bench.arm.positions[0] > ARM.ready[0] + 0.04)
    bench.loop.cancel(execution)
    bench.finish(execution)
    assert execution.status is GoalStatus.CANCELED
    rest = bench.arm.positions.copy()
    assert rest[0] < ARM.ready[0] + 0.07
    bench.turn(lambda: not bench.arm.in_control)
    np.testing.assert_allclose(bench.arm.positions, rest, atol=1e-9)


def test_a_hold_aborts_with_its_reason_and_brakes(bench: Bench) -> None:
    execution = bench.loop.start(goal())
    bench.turn(lambda: bench.arm.positions[0] > ARM.ready[0] + 0.04)
    bench.loop.hold("heartbeat lost")
    assert (execution.status, execution.error_string) == (GoalStatus.ABORTED, "heartbeat lost")
    assert np.any(bench.arm.velocities != 0.0)
    bench.turn(lambda: not bench.arm.in_control)
    assert not np.any(bench.arm.velocities)


def test_one_goal_at_a_time(bench: Bench) -> None:
    execution = bench.loop.start(goal())
    bench.loop.turn()
    with pytest.raises(GoalRejectedError, match="another goal is executed: cancel it first"):
        bench.loop.start(goal())
    bench.finish(execution)
    assert execution.status is GoalStatus.SUCCEEDED


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (goal(times=(0.0, 1.0, 1.0)), "times must strictly increase"),
        (goal(start=0.1), "first point is 0.100 rad from"),
        (goal(way=40.0, times=(0.0, 10.0, 200.0)), "rad beyond the upper limit of"),
        (goal(times=(0.0, 0.01, 0.02)), "speed jumps by|times the limit of"),
        (TrajectoryGoal(("a",), ()), "must name each joint of the arm once"),
    ],
)
def test_malformed_goals_are_rejected_in_words(bench: Bench, wrong: TrajectoryGoal, words: str) -> None:
    with pytest.raises(GoalRejectedError, match=words):
        bench.loop.check(wrong)
    bench.loop.turn()
    assert bench.arm.begun == 0


def test_an_arm_that_is_slow_near_its_ends_refuses_to_be_fast_there(bench: Bench) -> None:
    end = ARM.ready.copy()
    end[3] = ARM.limits.upper[3] - 0.01  # where 0.09 rad/s are allowed, in place of 2.62
    bench.arm.positions = end - np.array([0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    bench.loop.turn()

    def towards_it(duration: float) -> TrajectoryGoal:
        rows = np.array([bench.arm.positions, end])
        return TrajectoryGoal.from_arrays(ARM.arm_joints, (0.0, duration), rows, np.zeros((2, 7)))

    bench.loop.check(towards_it(4.0))
    with pytest.raises(GoalRejectedError, match=r"the speed is .* times the limit of fr3_joint4"):
        bench.loop.check(towards_it(0.5))


def test_a_reflex_aborts_and_refuses_until_the_errors_are_cleared(bench: Bench) -> None:
    execution = bench.loop.start(goal())
    bench.turn(lambda: bench.arm.positions[0] > ARM.ready[0] + 0.04)
    bench.arm.stops_with = "the arm stopped by itself: cartesian_reflex"
    bench.finish(execution)
    assert (execution.status, execution.error_string) == (GoalStatus.ABORTED, bench.arm.stops_with)
    bench.loop.turn()
    assert bench.states[-1].fault == bench.arm.stops_with
    with pytest.raises(GoalRejectedError, match="cartesian_reflex"):
        bench.loop.check(goal())
    bench.loop.start_thread()
    bench.loop.recover(20.0)
    bench.turn(lambda: not bench.loop.state.fault)
    bench.loop.stop_thread()
    assert bench.arm.closed


def test_its_own_thread_comes_first_and_no_other(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    first: list[str] = []
    monkeypatch.setattr(arm_loop, "put_this_thread_first", lambda: first.append(threading.current_thread().name))
    bench.loop.start_thread()
    bench.loop.stop_thread()
    assert first == ["arm"]


def test_errors_are_not_cleared_while_the_arm_is_controlled(bench: Bench) -> None:
    bench.finish(bench.loop.start(goal()))
    assert bench.arm.in_control
    asked: Future[None] = Future()
    bench.loop._recovery = asked
    bench.loop.turn()
    assert asked.result(0.0) is None
    assert bench.arm.in_control


def test_an_arm_that_is_stopped_by_its_user_takes_no_goal(bench: Bench) -> None:
    bench.arm.fault = "the user stop is pressed"
    bench.loop.turn()
    with pytest.raises(GoalRejectedError, match="the user stop is pressed"):
        bench.loop.check(goal())


def test_a_lost_arm_ends_the_loop_and_the_goal(bench: Bench) -> None:
    execution = bench.loop.start(goal())

    def lost() -> ArmState:
        raise ConnectionFailedError("no arm at 10.0.0.1")

    bench.arm.read = lost  # type: ignore[method-assign]
    bench.loop._run()
    assert [str(error) for error in bench.failures] == ["no arm at 10.0.0.1"]
    assert (execution.status, execution.error_string) == (GoalStatus.ABORTED, "no arm at 10.0.0.1")


def test_a_recovery_of_an_arm_that_was_lost_is_answered_at_once(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def lost() -> ArmState:
        raise ConnectionFailedError("the arm was lost")

    monkeypatch.setattr(bench.arm, "read", lost)
    asked: Future[None] = Future()
    bench.loop._recovery = asked  # it was asked for just before
    bench.loop._run()
    with pytest.raises(ArmFaultError, match="the arm was lost"):
        asked.result(0.0)
    with pytest.raises(ArmFaultError, match="the arm was lost"):
        bench.loop.recover(60.0)
    assert len(bench.failures) == 1
