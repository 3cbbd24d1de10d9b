"""What counts as a grasp: the gripper's answer, and where the fingers are measured afterwards."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, count, repeat
from types import SimpleNamespace
from typing import Any

import pytest
from control_msgs.action import GripperCommand

from panda_executor.action_call import ActionEnd
from panda_executor.action_gripper import ActionGripper
from panda_executor.errors import PortError
from panda_executor.ports import GripperResult, MotionStatus

MISSED = 0.005  # [m]
OBJECT = 0.03  # [m]


class Fingers:
    """Joint states that show these widths [m], one a look; None is a look without fresh states."""

    def __init__(self, widths: Iterator[float | None]) -> None:
        self._widths = widths

    def width(self, _: int) -> float:
        width = next(self._widths)
        if width is None:
            raise PortError("the joint states are old")
        return width


def close(
    status: MotionStatus, stalled: bool, widths: Iterator[float | None], held_from: float = MISSED, **kind: float
) -> GripperResult:
    """Tell a gripper to go to `asked` (0), which answers that it ended `reported` [m] apart."""
    result = GripperCommand.Result(position=kind.get("reported", OBJECT), stalled=stalled)
    caller: Any = SimpleNamespace(call=lambda *_: ActionEnd(status, result))
    clock = count(0, 20_000_000)
    fingers: Any = Fingers(widths)
    gripper = ActionGripper(caller, fingers, lambda: next(clock), held_from=held_from)
    return gripper.move(kind.get("asked", 0.0), 20.0, lambda: False)


def test_franka_gripper_calls_a_grasp_aborted_and_it_is_held() -> None:
    result = close(MotionStatus.ABORTED, False, repeat(OBJECT))
    assert (result.status, result.stalled, result.width) == (MotionStatus.SUCCEEDED, True, OBJECT)


def test_states_that_come_late_show_the_grasp_too() -> None:
    late: list[float | None] = [0.05, None, 0.04]
    assert close(MotionStatus.ABORTED, False, chain(late, repeat(OBJECT))).status is MotionStatus.SUCCEEDED


@pytest.mark.parametrize(
    ("widths", "kind"),
    [
        (chain(repeat(OBJECT, 5), repeat(0.08)), {}),  # the hand opened again
        (repeat(0.08), {}),  # it had opened when its states came
        (chain(repeat(OBJECT, 5), repeat(None)), {}),  # nobody sees the fingers
        (repeat(0.002), {"reported": 0.002}),  # closed on nothing
        (repeat(0.03), {"asked": 0.08}),  # jammed on the way to open
        (repeat(OBJECT), {"reported": math.nan}),
    ],
)
def test_other_aborted_goals_are_no_grasps(widths: Iterator[float | None], kind: dict[str, float]) -> None:
    assert close(MotionStatus.ABORTED, False, widths, **kind).status is MotionStatus.ABORTED


@pytest.mark.parametrize("status", [MotionStatus.CANCELLED, MotionStatus.TIMED_OUT])
def test_what_was_stopped_is_no_grasp(status: MotionStatus) -> None:
    assert close(status, False, repeat(OBJECT)).status is status


@pytest.mark.parametrize("confirmed", [True, False])
def test_fingers_whose_goal_may_live_on_do_not_stand(confirmed: bool) -> None:
    end = ActionEnd(MotionStatus.TIMED_OUT, message="late", confirmed=confirmed)
    caller: Any = SimpleNamespace(call=lambda *_: end)
    gripper = ActionGripper(caller, Fingers(repeat(OBJECT)), lambda: 0)  # type: ignore[arg-type]
    ended = gripper.move(0.0, 20.0, lambda: False)
    assert (ended.status, ended.message, ended.standing) == (MotionStatus.TIMED_OUT, "late", confirmed)


def test_a_gripper_that_says_stalled_is_believed_and_only_then() -> None:
    assert close(MotionStatus.ABORTED, True, repeat(OBJECT), math.inf).status is MotionStatus.SUCCEEDED
    assert close(MotionStatus.ABORTED, False, repeat(OBJECT), math.inf).status is MotionStatus.ABORTED


def test_a_grasp_that_is_stopped_while_it_is_judged_is_none() -> None:
    result = GripperCommand.Result(position=OBJECT, stalled=False)
    caller: Any = SimpleNamespace(call=lambda *_: ActionEnd(MotionStatus.ABORTED, result))
    fingers: Any = Fingers(repeat(OBJECT))
    looks = count()
    gripper = ActionGripper(caller, fingers, lambda: 0, held_from=MISSED)  # a clock that stands
    ended = gripper.move(0.0, 20.0, lambda: next(looks) > 3)
    assert (ended.status, ended.stalled) == (MotionStatus.ABORTED, False)


def test_a_move_ends_when_its_joint_states_have_come() -> None:
    looked: list[float | None] = []
    late: list[float | None] = [0.08, None, 0.05, OBJECT, OBJECT]

    def told() -> Iterator[float | None]:
        for width in late:
            looked.append(width)
            yield width

    assert close(MotionStatus.SUCCEEDED, True, told()).status is MotionStatus.SUCCEEDED
    assert looked == late[:4], "grasps are judged by them"


@pytest.mark.parametrize(("full", "width"), [(True, OBJECT), (False, 2.0 * OBJECT)])
def test_a_gripper_that_reports_half_of_the_width_is_understood(full: bool, width: float) -> None:
    result = GripperCommand.Result(position=OBJECT, stalled=True)
    caller: Any = SimpleNamespace(call=lambda *_: ActionEnd(MotionStatus.SUCCEEDED, result))
    gripper = ActionGripper(caller, Fingers(repeat(width)), lambda: 0, reports_full_width=full)  # type: ignore[arg-type]
    assert gripper.move(0.0, 20.0, lambda: False).width == pytest.approx(width)


def test_a_move_is_stopped_while_it_runs_and_the_next_is_not() -> None:
    told: list[bool] = []

    def call(goal: Any, patience: float, should_stop: Any) -> ActionEnd:
        told.append(should_stop())
        gripper.stop()
        told.append(should_stop())
        return ActionEnd(MotionStatus.CANCELLED, None, "stopped")

    caller: Any = SimpleNamespace(call=call)
    gripper = ActionGripper(caller, Fingers(repeat(OBJECT)), lambda: 0)  # type: ignore[arg-type]
    for _ in range(2):
        ended = gripper.move(0.0, 20.0, lambda: False)
        assert (ended.status, ended.message) == (MotionStatus.CANCELLED, "stopped") and math.isnan(ended.width)
    assert told == [False, True] * 2
