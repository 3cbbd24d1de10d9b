"""The arm's port against a clock that the test sets: how long a motion may take, and which joint states are frozen."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory

from panda_executor import action_arm
from panda_executor.action_arm import ActionArm
from panda_executor.action_call import TIME_FACTOR, TIME_SPARE, ActionEnd
from panda_executor.arm_watch import ArmWatch
from panda_executor.errors import PortError
from panda_executor.ports import MotionResult, MotionStatus
from panda_executor.trajectory import JointTrajectory
from panda_model import FloatArray, load_preset

PANDA = load_preset()
CODES = FollowJointTrajectory.Result
S = 1_000_000_000
WATCH = ArmWatch(standstill_time=0.5, frozen=0.5, frozen_way=0.125, goal_time=0.25)


def trajectory(seconds: int = 2, speed: float = 1.0, joint: int = 6) -> JointTrajectory:
    """One joint at an even speed [rad/s]; the others rest."""
    times = np.arange(seconds + 1.0)
    velocities = np.zeros((len(times), 7))
    velocities[:, joint] = speed
    return JointTrajectory(PANDA.arm_joints, times, velocities * times[:, None], velocities, 0.0 * velocities)


class Bench:
    """A port whose caller, joint states and clocks are played; the joint states have been the same for `same` [s]."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.wall = 10 * S, 64.0
        self.same, self.still_after = 0.0, 0.0
        self.log: list[str] = []
        self.call: Callable[..., ActionEnd] = lambda *_: ActionEnd(MotionStatus.SUCCEEDED, CODES())
        monkeypatch.setattr(action_arm, "time", SimpleNamespace(monotonic=lambda: self.wall, sleep=self._sleep))
        self.arm = ActionArm(
            SimpleNamespace(call=self._call, cancel_all=lambda: self.log.append("cancel all")),  # type: ignore[arg-type]
            self,  # type: ignore[arg-type]
            PANDA.arm_joints,
            lambda: self.now,
            WATCH,
            lambda: self.log.append("motion"),
        )

    def _call(self, *given: Any) -> ActionEnd:
        self.log.append("call")
        return self.call(*given)

    def _sleep(self, seconds: float) -> None:
        assert seconds == 0.01
        self.wall += 1.0 / 64.0

    def arm_positions(self, now_ns: int) -> FloatArray:
        """The joint tracker's, as the next three."""
        assert now_ns == self.now
        return np.arange(7.0)

    def is_still(self, now_ns: int) -> bool:
        assert now_ns == self.now
        return self.wall >= 64.0 + self.still_after

    def unchanged(self, now_ns: int) -> float:
        assert now_ns == self.now
        return self.same

    def distrust(self) -> None:
        self.log.append("distrust")

    def frozen_after(self, path: JointTrajectory, passed: float, same: float, accepted: bool = True) -> str:
        """Why a motion that began so long ago [s] is ended, whose joint states have been the same for so long."""

        def call(goal: Any, timeout: float, should_stop: Callable[[], bool], on_accepted: Any) -> ActionEnd:
            if accepted:
                on_accepted()
            self.now += int(passed * S)
            self.same = same
            assert should_stop() is False
            return ActionEnd(MotionStatus.SUCCEEDED, CODES())

        self.call = call
        self.log.clear()
        try:
            self.arm.execute(path, lambda: False)
        except PortError as error:
            assert self.log == ["motion", "call", "distrust"]
            return str(error)
        assert self.log == ["motion", "call"]
        return ""


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_the_limits_that_the_documentation_names() -> None:
    watch = ArmWatch()
    assert (watch.path_tolerance, watch.goal_tolerance, watch.goal_time) == (0.2, 0.01, 1.0)
    assert (watch.standstill_time, watch.frozen, watch.frozen_way) == (1.5, 0.4, 0.02)
    assert (TIME_FACTOR, TIME_SPARE) == (1.2, 0.5)


def test_a_motion_may_take_a_fifth_longer_and_settle(bench: Bench) -> None:
    given: list[Any] = []

    def call(goal: Any, timeout: float, *_: Any) -> ActionEnd:
        given.extend((goal, timeout))
        return ActionEnd(MotionStatus.SUCCEEDED, CODES(error_string="well done"))

    bench.call = call
    result = bench.arm.execute(trajectory(2), lambda: False)
    assert result == MotionResult(MotionStatus.SUCCEEDED, "well done", True)
    goal, timeout = given
    assert timeout == pytest.approx(1.2 * 2.0 + 0.25 + 0.5)
    assert goal.goal_time_tolerance.nanosec == S // 4
    assert list(goal.trajectory.joint_names) == list(PANDA.arm_joints)
    assert bench.log == ["motion", "call"], "it counts as moving before anything is sent"
    np.testing.assert_array_equal(bench.arm.joint_positions(), np.arange(7.0))


def test_a_stop_is_handed_on(bench: Bench) -> None:
    told = []

    def call(goal: Any, timeout: float, should_stop: Callable[[], bool], on_accepted: Any) -> ActionEnd:
        told.append(should_stop())
        return ActionEnd(MotionStatus.CANCELLED, None, "stopped on request")

    bench.call = call
    for stops in (True, False):
        result = bench.arm.execute(trajectory(1), lambda stops=stops: stops)  # type: ignore[misc]
        assert result == MotionResult(MotionStatus.CANCELLED, "stopped on request", True)
    assert told == [True, False]


@pytest.mark.parametrize(
    ("status", "code", "said", "words"),
    [
        (MotionStatus.SUCCEEDED, CODES.SUCCESSFUL, MotionStatus.SUCCEEDED, "text"),
        (MotionStatus.ABORTED, CODES.SUCCESSFUL, MotionStatus.ABORTED, "text"),
        (MotionStatus.SUCCEEDED, CODES.INVALID_GOAL, MotionStatus.ABORTED, "invalid goal: text"),
        (MotionStatus.CANCELLED, CODES.INVALID_GOAL, MotionStatus.CANCELLED, "invalid goal: text"),
        (MotionStatus.ABORTED, CODES.PATH_TOLERANCE_VIOLATED, MotionStatus.ABORTED, "path tolerance violated: text"),
        (MotionStatus.SUCCEEDED, CODES.GOAL_TOLERANCE_VIOLATED, MotionStatus.OFF_GOAL, "goal tolerance violated: text"),
        (MotionStatus.ABORTED, CODES.GOAL_TOLERANCE_VIOLATED, MotionStatus.OFF_GOAL, "goal tolerance violated: text"),
    ],
)
def test_what_the_controller_says_of_the_end(
    bench: Bench, status: MotionStatus, code: int, said: MotionStatus, words: str
) -> None:
    result = CODES(error_code=code, error_string="text")
    bench.call = lambda *_: ActionEnd(status, result)
    assert bench.arm.execute(trajectory(1), lambda: False) == MotionResult(said, words, True)
    bench.call = lambda *_: ActionEnd(MotionStatus.TIMED_OUT, result, "late")
    assert bench.arm.execute(trajectory(1), lambda: False) == MotionResult(MotionStatus.TIMED_OUT, "late", True)


@pytest.mark.parametrize(("after", "stands"), [(0.0, True), (0.5, True), (0.515625, True), (0.53125, False)])
def test_a_standstill_is_waited_for_half_a_second(bench: Bench, after: float, stands: bool) -> None:
    bench.still_after = after
    assert bench.arm.execute(trajectory(1), lambda: False).standing is stands
    assert bench.log == ["motion", "call", *([] if stands else ["cancel all"])]
    assert bench.wall == 64.0 + min(after, 0.515625)


def test_an_error_on_the_way_waits_for_the_standstill_too(bench: Bench) -> None:
    def call(*_: Any) -> ActionEnd:
        raise PortError("old")

    bench.call, bench.still_after = call, 9.0
    with pytest.raises(PortError, match="old"):
        bench.arm.execute(trajectory(1), lambda: False)
    assert bench.log == ["motion", "call", "cancel all"]


EVEN = trajectory(4)


@pytest.mark.parametrize(
    ("passed", "same", "frozen"),
    [
        (1.5, 0.49, False),
        (1.5, 0.5, True),
        (0.49, 9.0, False),  # the rest before the motion does not count
        (3.75, 1.0, True),
        (3.999, 1.0, True),
        (4.0, 2.0, False),  # the path has ended
        (9.0, 6.0, False),
    ],
)
def test_states_that_stay_the_same_while_the_path_goes_on_are_frozen(
    bench: Bench, passed: float, same: float, frozen: bool
) -> None:
    words = f"the joint states have been the same for {min(same, passed):.1f} s of a motion (at most 0.5 s); does "
    said = bench.frozen_after(EVEN, passed, same)
    assert said == (f"{words}something stamp old ones anew?" if frozen else "")


def test_before_the_controller_took_the_goal_nothing_is_frozen(bench: Bench) -> None:
    assert bench.frozen_after(EVEN, 1.5, 1.0, accepted=False) == ""


@pytest.mark.parametrize("joint", [0, 4, 6])
@pytest.mark.parametrize(("speed", "frozen"), [(0.17, True), (0.16, False), (-0.17, True), (-0.16, False)])
def test_a_path_that_hardly_moves_meanwhile_is_not_frozen(bench: Bench, joint: int, speed: float, frozen: bool) -> None:
    """What the path does from the last new states to a quarter of a second ago must show by now: 0.125 rad and more."""
    path = trajectory(5, speed, joint)
    assert bool(bench.frozen_after(path, 3.0, 1.0)) is frozen
    assert bool(bench.frozen_after(path, 1.0, 9.0)) is frozen, "the path began a second ago"
    assert not bench.frozen_after(path, 3.0, 0.9)
