"""When the executor's ports over the simulator give a motion up, and what they say of one that ended."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_benchmark.sim_arm import SimArmPort, SimGripperPort
from panda_executor.ports import GripperResult, MotionResult, MotionStatus
from panda_executor.trajectory import JointTrajectory
from sim_bridge.control import ErrorCode, GoalStatus

STILL = np.zeros((2, 7))
TRAJECTORY = JointTrajectory(tuple(f"joint{n}" for n in range(7)), np.array([0.0, 1.5]), STILL, STILL, STILL)


class Controller:
    """Takes each goal, ends it after so many ticks (None: never), and knows what it was told, and when."""

    def __init__(self, ticks: int | None, **ending: Any) -> None:
        self.ticks, self.ending, self.told = ticks, ending, list[tuple[float, Any]]()
        self.time, self.goal = 2.0, None
        self.execution = SimpleNamespace(done=False)
        self.world = SimpleNamespace(panda=SimpleNamespace(state=lambda: SimpleNamespace(width=0.03)))

    @property
    def arm(self) -> Controller:
        return self

    gripper = arm

    def start(self, goal: Any, now: float) -> Any:
        assert now == 2.0
        self.goal = goal
        self._end_after_ticks()
        return self.execution

    def cancel(self) -> None:
        self.told.append((self.time, "cancel"))
        self.ticks = 0

    def hold(self, why: str) -> None:
        self.told.append((self.time, why))

    def tick(self) -> None:
        self.time += 0.25
        if self.ticks is not None:
            self.ticks -= 1
        self._end_after_ticks()

    def _end_after_ticks(self) -> None:
        if self.ticks is not None and self.ticks <= 0:
            vars(self.execution).update(done=True, **self.ending)


def arm(motion: Any, stop: bool = False) -> MotionResult:
    return SimArmPort(motion).execute(TRAJECTORY, lambda: stop)


def hand(motion: Any, stop: bool = False) -> GripperResult:
    return SimGripperPort(motion).move(0.06, 20.0, lambda: stop)


def test_an_arm_that_does_not_end_is_held_three_seconds_after_it_should_have() -> None:
    never = Controller(None)
    assert arm(never) == MotionResult(MotionStatus.TIMED_OUT, "not done 3.0 s after its end")
    assert never.told == [(6.75, "took too long")]
    late = Controller(18, status=GoalStatus.SUCCEEDED, error_code=ErrorCode.SUCCESSFUL, error_string="")
    assert arm(late) == MotionResult(MotionStatus.SUCCEEDED, "") and late.told == []
    assert late.goal.goal_time_tolerance == 1.0


@pytest.mark.parametrize(
    ("status", "code", "found"),
    [
        (GoalStatus.ABORTED, ErrorCode.GOAL_TOLERANCE_VIOLATED, MotionStatus.OFF_GOAL),
        (GoalStatus.ABORTED, ErrorCode.PATH_TOLERANCE_VIOLATED, MotionStatus.ABORTED),
        (GoalStatus.CANCELED, ErrorCode.SUCCESSFUL, MotionStatus.CANCELLED),
        (GoalStatus.SUCCEEDED, ErrorCode.SUCCESSFUL, MotionStatus.SUCCEEDED),
    ],
)
def test_what_the_arms_controller_says_is_passed_on(status: Any, code: Any, found: MotionStatus) -> None:
    assert arm(Controller(1, status=status, error_code=code, error_string="why")) == MotionResult(found, "why")


def test_a_hand_that_does_not_arrive_is_held_after_five_seconds() -> None:
    never = Controller(None)
    expected = GripperResult(0.03, False, False, MotionStatus.TIMED_OUT, "the hand did not arrive in 5.0 s")
    assert hand(never) == expected and never.told == [(7.25, "took too long")]
    assert (never.goal.position, never.goal.max_effort) == (0.03, 20.0)


@pytest.mark.parametrize(
    ("result", "flags"),
    [
        (None, (False, False)),
        (SimpleNamespace(stalled=True, reached_goal=False), (True, False)),
        (SimpleNamespace(stalled=False, reached_goal=True), (False, True)),
    ],
)
def test_what_the_hands_controller_says_is_passed_on(result: Any, flags: tuple[bool, bool]) -> None:
    ended = Controller(1, status=GoalStatus.ABORTED, result=result, message="why")
    assert hand(ended) == GripperResult(0.03, *flags, MotionStatus.ABORTED, "why")


def test_a_stop_cancels_the_goal_once() -> None:
    moving = Controller(None, status=GoalStatus.CANCELED, error_code=ErrorCode.SUCCESSFUL, error_string="stopped")
    assert arm(moving, stop=True) == MotionResult(MotionStatus.CANCELLED, "stopped")
    closing = Controller(None, status=GoalStatus.CANCELED, result=None, message="stopped")
    assert hand(closing, stop=True) == GripperResult(0.03, False, False, MotionStatus.CANCELLED, "stopped")
    SimGripperPort(closing).stop()  # type: ignore[arg-type]
    assert moving.told == [(2.0, "cancel")] and closing.told == [(2.0, "cancel"), (2.25, "cancel")]
