"""A gripper behind franka_msgs: which action is sent, and what counts as done."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import chain, count, repeat
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("franka_msgs")

from franka_msgs.action import Grasp, Move

from panda_executor.action_call import ActionEnd
from panda_executor.action_franka_gripper import FrankaGripper
from panda_executor.errors import PortError
from panda_executor.ports import MotionStatus
from panda_model import load_preset

HAND = load_preset("panda").hand


class Bench:
    """A gripper whose actions end as they are told, over joint states that show these widths [m], one a look."""

    def __init__(self, widths: Iterator[float | None], end: ActionEnd | None = None) -> None:
        self.sent: list[tuple[str, Any]] = []
        self._widths, self._end = widths, end or ActionEnd(MotionStatus.SUCCEEDED, Grasp.Result(success=True))
        clock, joints = count(0, 20_000_000), SimpleNamespace(width=self._width)
        self.gripper = FrankaGripper(
            self._caller("grasp"), self._caller("move"), joints, lambda: next(clock), HAND  # type: ignore[arg-type]
        )  # fmt: skip

    def _width(self, _: int) -> float:
        width = next(self._widths)
        if width is None:
            raise PortError("the joint states are old")
        return width

    def _caller(self, name: str) -> Any:
        def call(goal: Any, timeout: float, should_stop: Any) -> ActionEnd:
            self.sent.append((name, goal))
            assert timeout > HAND.opening / HAND.speed and not should_stop()
            return self._end

        return SimpleNamespace(call=call)


def never() -> bool:
    return False


def test_closing_is_a_grasp_whose_epsilon_is_the_whole_hand() -> None:
    bench = Bench(chain([0.08], repeat(0.03)))
    result = bench.gripper.move(0.0, 25.0, never)
    [(name, goal)] = bench.sent
    assert (name, type(goal), goal.width, goal.force, goal.speed) == ("grasp", Grasp.Goal, 0.0, 25.0, HAND.speed)
    assert (goal.epsilon.inner, goal.epsilon.outer) == (HAND.opening, HAND.opening)
    assert (result.status, result.width, result.stalled, result.reached_goal) == (
        MotionStatus.SUCCEEDED, 0.03, True, False,
    )  # fmt: skip


def test_closing_on_nothing_reaches_its_width() -> None:
    result = Bench(chain([0.08, 0.04, None, 0.01], repeat(0.0))).gripper.move(0.0, 25.0, never)
    assert (result.width, result.stalled, result.reached_goal) == (0.0, False, True)


def test_opening_is_a_move_that_has_to_arrive() -> None:
    bench = Bench(chain([0.03], repeat(0.06)))
    assert bench.gripper.move(0.06, 20.0, never).reached_goal
    [(name, goal)] = bench.sent
    assert (name, type(goal), goal.width, goal.speed) == ("move", Move.Goal, 0.06, HAND.speed)
    result = Bench(repeat(0.03)).gripper.move(0.06, 20.0, never)
    assert (result.status, result.message) == (
        MotionStatus.ABORTED, "the fingers stand at 0.0300 m, asked for 0.0600 m",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("end", "words"),
    [
        (ActionEnd(MotionStatus.ABORTED, Grasp.Result(error="command failed")), "command failed"),
        (ActionEnd(MotionStatus.UNAVAILABLE, None, "no action server at /g/grasp"), "no action server at /g/grasp"),
        (ActionEnd(MotionStatus.TIMED_OUT, None, "late", confirmed=False), "late"),
    ],
)
def test_a_grasp_that_failed_is_none_whatever_the_fingers_show(end: ActionEnd, words: str) -> None:
    result = Bench(chain([0.08], repeat(0.03)), end).gripper.move(0.0, 20.0, never)
    assert (result.status, result.message, math.isnan(result.width)) == (end.status, words, True)
    assert result.standing is end.confirmed


def test_old_joint_states_are_no_width(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("panda_executor.action_franka_gripper._SETTLE", 0.1)
    result = Bench(chain([0.08], repeat(None))).gripper.move(0.0, 20.0, never)
    assert result.status is MotionStatus.ABORTED
    with pytest.raises(PortError):
        Bench(repeat(None)).gripper.move(0.0, 20.0, never)


def test_a_stop_ends_the_call() -> None:
    bench = Bench(repeat(0.08))
    asked: list[bool] = []

    def call(goal: Any, timeout: float, should_stop: Any) -> ActionEnd:
        bench.gripper.stop()
        asked.append(should_stop())
        return ActionEnd(MotionStatus.CANCELLED, None, "stopped on request")

    bench.gripper._grasp = SimpleNamespace(call=call)  # type: ignore[assignment]
    result = bench.gripper.move(0.0, 20.0, never)
    assert (asked, result.status) == ([True], MotionStatus.CANCELLED)
