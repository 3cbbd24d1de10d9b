"""The arm's port over a caller that is played: what it demands of joint states on the way and at the end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory

from panda_executor import action_arm
from panda_executor.action_arm import ActionArm
from panda_executor.action_call import ActionEnd
from panda_executor.arm_watch import ArmWatch
from panda_executor.errors import PortError
from panda_executor.joint_tracker import JointTracker
from panda_executor.ports import MotionResult, MotionStatus
from panda_executor.trajectory import JointTrajectory
from panda_model import load_preset

S = 1_000_000_000
PANDA = load_preset()
STEP_NS = 20_000_000


def one_second(way: float) -> JointTrajectory:
    """A motion of every joint by `way` [rad]."""
    positions = np.stack([np.zeros(7), np.full(7, way)])
    still = np.zeros((2, 7))
    return JointTrajectory(PANDA.arm_joints, np.array([0.0, 1.0]), positions, still, still)


class Bench:
    """A controller that follows, told by `measure` what the joint states say at each time."""

    def __init__(
        self, measure: Callable[[float], float | None], watch: ArmWatch | None = None, takes_it_after: float = 0.0
    ) -> None:
        self.now_ns, self.measure, self.answers_ns = 0, measure, int(takes_it_after * S)
        self.cancelled_all, self.ended_ns = 0, 0
        self.goal: Any = None
        self.joints = JointTracker(PANDA.arm_joints, PANDA.finger_joints)
        self.motions = 0
        self.arm = ActionArm(self, self.joints, PANDA.arm_joints, self.tick, watch, self._moves)  # type: ignore[arg-type]

    def _moves(self) -> None:
        self.motions += 1

    def tick(self) -> int:
        """Return the time; each look at the clock is 20 ms later, and brings joint states."""
        self.now_ns += STEP_NS
        measured = self.measure(self.now_ns / S)
        if measured is not None:
            self.joints.update(PANDA.arm_joints, np.full(7, measured), self.now_ns)
        return self.now_ns

    def cancel_all(self) -> None:
        self.cancelled_all += 1

    def call(
        self, goal: Any, timeout: float, should_stop: Callable[[], bool], on_accepted: Callable[[], None]
    ) -> ActionEnd:
        """The caller."""
        self.goal, answered = goal, self.now_ns + self.answers_ns
        try:
            while self.now_ns < answered:
                assert not should_stop()
            on_accepted()
            end = self.now_ns + S
            while self.now_ns < end:
                assert not should_stop()
        finally:
            self.ended_ns = self.now_ns
        return ActionEnd(MotionStatus.SUCCEEDED, FollowJointTrajectory.Result())

    def execute(self, way: float = 0.5) -> MotionResult:
        return self.arm.execute(one_second(way), lambda: False)


@pytest.fixture(autouse=True)
def _no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_arm, "_POLL", 0.0)


def following(time: float) -> float:
    return 0.5 * min(time, 1.0)


def test_a_motion_ends_at_a_measured_standstill() -> None:
    bench = Bench(following)
    assert bench.execute() == MotionResult(MotionStatus.SUCCEEDED, "", standing=True)
    assert bench.now_ns > S + 60_000_000  # it was seen at rest after its end
    assert (bench.motions, bench.cancelled_all) == (1, 0)


def test_tolerances_are_sent() -> None:
    bench = Bench(following, ArmWatch(path_tolerance=0.15, goal_tolerance=0.02))
    bench.execute()
    assert [tolerance.name for tolerance in bench.goal.path_tolerance] == list(PANDA.arm_joints)
    assert {tolerance.position for tolerance in bench.goal.path_tolerance} == {0.15}
    assert {tolerance.position for tolerance in bench.goal.goal_tolerance} == {0.02}


def test_an_arm_that_goes_on_is_not_said_to_hold() -> None:
    bench = Bench(lambda time: 0.5 * time, ArmWatch(standstill_time=0.02))
    result = bench.execute()
    assert not result.standing
    assert bench.cancelled_all == 1


@pytest.mark.parametrize("status", [MotionStatus.TIMED_OUT, MotionStatus.CANCELLED])
def test_an_arm_whose_goal_may_live_on_does_not_stand(status: MotionStatus, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is measured at rest, but nobody said that the goal is over."""
    bench = Bench(lambda time: 0.5)
    words = "late; the cancel was not confirmed"
    monkeypatch.setattr(bench, "call", lambda *_: ActionEnd(status, message=words, confirmed=False))
    assert bench.execute() == MotionResult(status, words, standing=False)
    monkeypatch.setattr(bench, "call", lambda *_: ActionEnd(status, message="late"))
    assert bench.execute() == MotionResult(status, "late", standing=True)


def test_joint_states_that_end_on_the_way_stop_the_arm() -> None:
    bench = Bench(lambda time: following(time) if time < 0.3 else None, ArmWatch(standstill_time=0.02))
    with pytest.raises(PortError, match=r"s old|have been the same"):
        bench.execute()
    assert bench.ended_ns < 0.9 * S


def test_joint_states_that_are_stamped_anew_stop_the_arm() -> None:
    bench = Bench(lambda time: following(min(time, 0.3)), ArmWatch(standstill_time=0.02))
    with pytest.raises(PortError, match="have been the same for"):
        bench.execute()
    assert bench.ended_ns < 0.8 * S
    assert not bench.joints.is_still(bench.now_ns)


def test_a_controller_that_takes_the_goal_late_is_not_taken_for_frozen_joint_states() -> None:
    """An arm at rest whose states are the same to the last bit, as with mock hardware."""
    bench = Bench(lambda time: following(max(time - 1.0, 0.0)), takes_it_after=1.0)
    assert bench.execute() == MotionResult(MotionStatus.SUCCEEDED, "", standing=True)


def test_the_rest_before_a_motion_does_not_count_as_frozen() -> None:
    bench = Bench(lambda time: 0.0, watch=ArmWatch(standstill_time=0.02), takes_it_after=30.0)
    with pytest.raises(PortError, match=r"have been the same for 0\.\d s of a motion"):
        bench.execute()


def test_everything_is_cancelled_where_the_arm_is_not_seen_to_rest_after_an_error() -> None:
    bench = Bench(lambda time: following(time) if time < 0.3 else None, ArmWatch(standstill_time=0.02))
    with pytest.raises(PortError):
        bench.execute()
    assert bench.cancelled_all == 1


def test_an_end_off_the_goal_is_told_from_an_abort(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(following)
    code = FollowJointTrajectory.Result.GOAL_TOLERANCE_VIOLATED
    ended = ActionEnd(MotionStatus.ABORTED, FollowJointTrajectory.Result(error_code=code))
    monkeypatch.setattr(bench, "call", lambda *_: ended)
    bench.now_ns = 2 * S
    assert bench.execute().status is MotionStatus.OFF_GOAL


def test_an_arm_that_is_to_rest_may_do_so() -> None:
    assert Bench(lambda time: 0.0).execute(0.0).status is MotionStatus.SUCCEEDED
