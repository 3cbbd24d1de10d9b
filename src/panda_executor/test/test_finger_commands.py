"""The fingers of a run: when they need not move, what they are known to hold, and when they have let go."""

from __future__ import annotations

import numpy as np
import pytest
from commands_bench import CONFIG, OPEN, PANDA, CommandBench

from cliport_core.outcome import Outcome
from panda_executor.errors import PortError
from panda_executor.hand_geometry import HandShape
from panda_executor.ports import GripperResult, MotionStatus, ShouldStop
from panda_executor.run_commands import EarlyEnd, RunCommands


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> CommandBench:
    return CommandBench(monkeypatch)


@pytest.mark.parametrize(
    ("width", "moves"),
    [
        (0.0, True),
        (0.0406, True),
        (0.0404, False),
        (0.04, False),
        (0.0371, False),
        (0.0369, True),
    ],
)
def test_fingers_that_are_nearly_there_are_let_be(bench: CommandBench, width: float, moves: bool) -> None:
    """Half a millimetre too close, or three too wide, is there; closing on something is always done."""
    bench.gripper.object_width = 0.0
    bench.commands.move_fingers(width, 13.0)
    assert bench.gripper.moves == ([width] if moves else [])
    assert bench.gripper.efforts == ((13.0,) if moves else ())


def test_closed_fingers_are_told_to_close_again(bench: CommandBench) -> None:
    """Only a motion says whether they press on something."""
    bench.gripper.opening = bench.gripper.object_width = 0.0
    bench.commands.move_fingers(0.0, 13.0)
    assert bench.gripper.moves == [0.0]


def test_fingers_that_stand_open_are_known_to_hold_nothing(bench: CommandBench) -> None:
    for width, told, holds in ((OPEN, OPEN, False), (0.04, 0.04, True)):
        bench.gripper.opening = width
        bench.hand.note(0.0, width)
        bench.commands.move_fingers(told, 13.0)
        assert bench.hand.holds(width) is holds
        assert not bench.gripper.moves


def test_what_the_hand_closed_on_is_remembered_with_its_shape(bench: CommandBench) -> None:
    bench.gripper.opening, bench.gripper.object_width = 0.06, 0.04
    load = HandShape(CONFIG.hand, 0.04)
    bench.commands.check_empty()
    bench.commands.move_fingers(0.0, 13.0, load)
    assert bench.commands.hand_shape() is load
    with pytest.raises(Exception, match="still holds something 40 mm wide"):
        bench.commands.check_empty()
    bench.commands.move_fingers(OPEN, 13.0)
    empty = bench.commands.hand_shape()
    assert empty is not load and (empty.hand, empty.width) == (CONFIG.hand, None)


@pytest.mark.parametrize(("width", "known"), [(0.0, True), (0.06, False)])
def test_what_a_failing_gripper_did_is_measured_where_it_was_to_close(
    bench: CommandBench, width: float, known: bool
) -> None:
    bench.hand.note(0.0, 0.04)
    bench.gripper.opening = 0.05 if known else 0.04
    bench.gripper.failure = GripperResult(0.05, False, False, MotionStatus.ABORTED, "jammed")
    with pytest.raises(EarlyEnd, match="the gripper's motion aborted: jammed") as caught:
        bench.commands.move_fingers(width, 13.0)
    assert caught.value.may_recover and caught.value.outcome is Outcome.EXECUTION_FAILED
    assert bench.hand.holds(bench.gripper.opening), "what was held before, or what it closed on"


@pytest.mark.parametrize("stop", [False, True])
@pytest.mark.parametrize("width", [0.0, 0.06])
def test_nothing_follows_on_fingers_that_may_still_move(
    bench: CommandBench, width: float, stop: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def move(width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        bench.stops = lambda: stop
        bench.gripper.opening = 0.05
        return GripperResult(0.05, False, False, MotionStatus.TIMED_OUT, "the cancel was not confirmed", False)

    monkeypatch.setattr(bench.gripper, "move", move)
    command = bench.commands.let_go if width else lambda width: bench.commands.move_fingers(width, 13.0)
    with pytest.raises(EarlyEnd) as caught:
        command(width)
    end = caught.value
    assert (end.outcome, end.may_recover) == (Outcome.CANCELLED if stop else Outcome.EXECUTION_FAILED, False)
    assert str(end) == "the fingers may still move: the cancel was not confirmed; look before you go on"
    assert bench.hand.holds(0.03) is (width == 0.0), "fingers that go on to close may hold something"


@pytest.mark.parametrize(("look", "moves"), [(1, 0), (3, 1)])
def test_a_stop_of_the_fingers_is_a_cancel(bench: CommandBench, look: int, moves: int) -> None:
    bench.stop_at(look)
    with pytest.raises(EarlyEnd) as caught:
        bench.commands.move_fingers(0.08, 13.0)
    assert caught.value.outcome is Outcome.CANCELLED
    assert len(bench.gripper.moves) == moves


@pytest.mark.parametrize(
    ("held", "asked", "told"),
    [(0.04, 0.06, 0.06), (0.04, 0.041, 0.046), (0.078, 0.06, OPEN), (0.05, OPEN + 0.02, OPEN)],
)
def test_it_opens_far_enough_to_let_go(bench: CommandBench, held: float, asked: float, told: float) -> None:
    bench.gripper.opening = held
    bench.commands.let_go(asked)
    assert bench.gripper.moves == pytest.approx([told])
    assert bench.gripper.efforts == (CONFIG.open_force,)


@pytest.mark.parametrize(
    ("opened", "status", "free"),
    [
        (0.0429, MotionStatus.ABORTED, False),
        (0.0431, MotionStatus.ABORTED, True),
        (0.0431, MotionStatus.CANCELLED, False),
    ],
)
def test_fingers_that_met_a_neighbour_have_let_go(
    bench: CommandBench, opened: float, status: MotionStatus, free: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where somebody else cancelled their motion, that was a stop: the arm does not go on."""

    def move(width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        bench.gripper.opening = opened
        return GripperResult(opened, False, False, status, "in the way")

    monkeypatch.setattr(bench.gripper, "move", move)
    if free:
        bench.commands.let_go(0.06)
    else:
        with pytest.raises(EarlyEnd, match="in the way"):
            bench.commands.let_go(0.06)


def test_a_stop_is_a_stop_also_where_the_object_is_free(bench: CommandBench) -> None:
    bench.stops = lambda: bench.gripper.opening > 0.05
    with pytest.raises(EarlyEnd, match="cancelled"):
        bench.commands.let_go(0.06)


def test_what_the_ports_say_is_handed_on(bench: CommandBench) -> None:
    positions = bench.commands.positions()
    np.testing.assert_array_equal(positions, bench.arm.positions)
    positions += 1.0
    np.testing.assert_array_equal(bench.arm.positions, PANDA.ready)
    assert bench.commands.width() == 0.04
    plain = RunCommands(bench.arm, bench.gripper, CONFIG, PANDA.limits, lambda *_: None, lambda: False)
    assert plain.offer([]) is False and not plain.moved

    def fail() -> float:
        raise PortError("old")

    bench.gripper.width = fail  # type: ignore[method-assign]
    with pytest.raises(PortError):
        bench.commands.width()
