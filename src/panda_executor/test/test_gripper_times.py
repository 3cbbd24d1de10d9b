"""The gripper against a clock that the test sets: what it is told, and how long it waits for its joint states."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from control_msgs.action import GripperCommand

from panda_executor import action_gripper
from panda_executor.action_call import ActionEnd
from panda_executor.action_gripper import ActionGripper
from panda_executor.errors import PortError
from panda_executor.ports import GripperResult, MotionStatus

OBJECT = 0.03125  # [m], held exactly by floats
STEP = 1.0 / 64.0  # each sleep [s]
ENDS = 100.0  # the time at which the action ends [s]


class Bench:
    """A gripper whose action ends at once; `measure` is what its joint states show so long after that."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.rate = ENDS, 1.0
        self.measure: Callable[[float], float | None] = lambda after: OBJECT
        self.calls: list[tuple[GripperCommand.Goal, float]] = []
        self.looks: list[int] = []
        monkeypatch.setattr(action_gripper, "time", SimpleNamespace(monotonic=lambda: self.now, sleep=self._sleep))

    def _sleep(self, seconds: float) -> None:
        assert seconds == 0.01
        self.now += STEP

    def width(self, now_ns: int) -> float:
        """The joint tracker's."""
        self.looks.append(now_ns)
        width = self.measure(self.now - ENDS)
        if width is None:
            raise PortError("old")
        return width

    def now_ns(self) -> int:
        return int((ENDS + self.rate * (self.now - ENDS)) * 1e9)

    def move(
        self,
        width: float,
        status: MotionStatus = MotionStatus.SUCCEEDED,
        stalled: bool = False,
        held_from: float = 0.005,
        position: float = OBJECT,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> GripperResult:
        result = GripperCommand.Result(position=position, stalled=stalled, reached_goal=not stalled)

        def call(goal: GripperCommand.Goal, timeout: float, stop: Any) -> ActionEnd:
            self.calls.append((goal, timeout))
            return ActionEnd(status, result, "the gripper's words")

        self.now = ENDS
        caller: Any = SimpleNamespace(call=call)
        return ActionGripper(caller, self, self.now_ns, held_from=held_from).move(width, 17.0, should_stop)  # type: ignore[arg-type]

    @property
    def waited(self) -> float:
        return self.now - ENDS


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


@pytest.mark.parametrize("stalled", [False, True])
def test_it_is_told_half_of_the_width_and_all_comes_back(bench: Bench, stalled: bool) -> None:
    result = bench.move(0.06, stalled=stalled)
    assert result == GripperResult(OBJECT, stalled, not stalled, MotionStatus.SUCCEEDED, "the gripper's words")
    goal, timeout = bench.calls[0]
    assert (goal.command.position, goal.command.max_effort) == (0.03, 17.0)
    assert timeout == pytest.approx(1.2 * 4.0 + 0.5)
    assert bench.waited == 0.0 and bench.looks == [int(ENDS * 1e9)]


@pytest.mark.parametrize(("off", "waits"), [(0.0039, False), (0.0041, True), (-0.0039, False), (-0.0041, True)])
def test_joint_states_agree_within_four_millimetres(bench: Bench, off: float, waits: bool) -> None:
    bench.measure = lambda after: OBJECT + (off if after < 0.25 else 0.0)
    bench.move(0.06)
    assert bench.waited == (0.25 if waits else 0.0)


@pytest.mark.parametrize("shown", [None, 0.08])
def test_joint_states_that_never_agree_are_waited_for_a_second(bench: Bench, shown: float | None) -> None:
    bench.measure = lambda after: shown
    assert bench.move(0.06).status is MotionStatus.SUCCEEDED
    assert bench.waited == 1.0


def test_a_stop_ends_the_wait_for_joint_states(bench: Bench) -> None:
    bench.measure = lambda after: 0.08
    bench.move(0.06, should_stop=lambda: bench.now >= ENDS + 0.5)
    assert bench.waited == 0.5


@pytest.mark.parametrize("status", [MotionStatus.ABORTED, MotionStatus.CANCELLED, MotionStatus.REJECTED])
def test_nothing_is_waited_for_where_the_fingers_did_not_get_there(bench: Bench, status: MotionStatus) -> None:
    result = bench.move(0.06, status)
    assert (result.status, result.stalled) == (status, False)
    assert not bench.looks


def test_what_is_held_is_seen_to_be_for_three_tenths_of_a_second(bench: Bench) -> None:
    """It is looked at for 300 ms of ROS time, however long that takes."""
    result = bench.move(0.0, MotionStatus.ABORTED)
    assert (result.status, result.stalled, bench.waited) == (MotionStatus.SUCCEEDED, True, 0.3125)
    bench.rate = 0.5
    assert bench.move(0.0, MotionStatus.ABORTED).status is MotionStatus.SUCCEEDED
    assert bench.waited == 0.609375
    bench.rate = 0.25
    assert bench.move(0.0, MotionStatus.ABORTED).status is MotionStatus.ABORTED, "a second is all it gets"
    assert bench.waited == 1.0 + STEP


@pytest.mark.parametrize(("opens", "held"), [(0.296, False), (0.32, True)])
@pytest.mark.parametrize("to", [OBJECT + 0.0041, OBJECT - 0.0041, None])
def test_fingers_that_do_not_stay_hold_nothing(bench: Bench, opens: float, held: bool, to: float | None) -> None:
    bench.measure = lambda after: OBJECT if after < opens else to
    status = bench.move(0.0, MotionStatus.ABORTED).status
    assert status is (MotionStatus.SUCCEEDED if held else MotionStatus.ABORTED)


def test_fingers_may_give_way_a_little_round_what_they_hold(bench: Bench) -> None:
    bench.measure = lambda after: OBJECT if after < 0.1 else OBJECT - 0.0039
    assert bench.move(0.0, MotionStatus.ABORTED).status is MotionStatus.SUCCEEDED


@pytest.mark.parametrize(
    ("asked", "position", "held"),
    [
        (0.0, OBJECT, True),
        (0.0, 0.03, False),
        (OBJECT, 0.05, False),
        (0.031, OBJECT, True),
        (0.04, 0.05, False),
    ],
)
def test_closing_that_ended_wide_enough_is_a_grasp(bench: Bench, asked: float, position: float, held: bool) -> None:
    """Told to go closer than the least width of anything, the fingers stand at that width or wider."""
    bench.measure = lambda after: position
    result = bench.move(asked, MotionStatus.ABORTED, held_from=OBJECT, position=position)
    assert (result.status is MotionStatus.SUCCEEDED) is held
    assert bool(bench.looks) is held, "what cannot be a grasp is not waited for"


def test_the_width_is_asked_for_now(bench: Bench) -> None:
    bench.now = ENDS + 2.0
    gripper = ActionGripper(SimpleNamespace(), bench, bench.now_ns)  # type: ignore[arg-type]
    assert gripper.width() == OBJECT
    assert bench.looks == [int((ENDS + 2.0) * 1e9)]
