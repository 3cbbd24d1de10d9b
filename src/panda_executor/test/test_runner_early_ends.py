"""Requests that end early: the arm or the gripper fails, the object is missed or lost, or somebody cancels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from runner_bench import MOTIONS, PICK_PLACE_PHASES, READY_POSITIONS, Bench, runner_bench

from cliport_core.outcome import Outcome
from panda_executor.errors import PortError
from panda_executor.phase import Phase
from panda_executor.ports import GripperResult, MotionResult, MotionStatus, ShouldStop
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray


@pytest.fixture(scope="session")
def planner(planned_once: TransferPlanner) -> TransferPlanner:
    return planned_once


@pytest.fixture
def bench(planner: TransferPlanner, table_cloud: np.ndarray) -> Bench:
    return runner_bench(planner, table_cloud)


@pytest.mark.parametrize("number", range(7))
def test_execution_failed_when_the_arm_aborts(bench: Bench, number: int) -> None:
    bench.arm.fail_at = number
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    phase = MOTIONS[number].name.lower()
    assert result.message == f"the arm's motion aborted during {phase}: path tolerance violated"
    assert len(bench.arm.sent) == number + 1


@pytest.mark.parametrize("status", [s for s in MotionStatus if s is not MotionStatus.SUCCEEDED])
def test_execution_failed_for_every_status(bench: Bench, status: MotionStatus) -> None:
    bench.arm.fail_at, bench.arm.failure = 0, MotionResult(status)
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    why = "somebody else cancelled it" if status is MotionStatus.CANCELLED else "no reason given"
    assert f"the arm's motion {status.value} during go_above_pick: {why}" in result.message


@pytest.mark.parametrize("number", [1, 3, 5])
def test_nothing_follows_a_motion_that_was_not_seen_to_end(bench: Bench, number: int) -> None:
    """A drop whose cancel was not confirmed: the fingers stay, and no other trajectory is sent."""

    def lose(motion: int, share: float) -> None:
        if motion == number == 3 and share > 0.5:
            bench.gripper.lose_object()

    bench.arm.on_step = lose
    bench.arm.fail_at = number
    bench.arm.failure = MotionResult(MotionStatus.CANCELLED, "the cancel was not confirmed", standing=False)
    bench.arm.standing = number != 3
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert "the arm may still move" in result.message and "holds" not in result.message
    assert len(bench.arm.sent) == number + 1
    assert len(bench.gripper.moves) == {1: 1, 3: 2, 5: 3}[number]


def test_execution_failed_when_the_gripper_fails(bench: Bench) -> None:
    bench.gripper.failure = GripperResult(math.nan, False, False, MotionStatus.UNAVAILABLE, "no action server")
    result = bench.run()
    assert (result.outcome, bench.commands) == (Outcome.EXECUTION_FAILED, (1, 1))
    assert result.message == "the gripper's motion unavailable: no action server"


@pytest.mark.parametrize("reads", [0, 1, 3])
def test_execution_failed_when_joint_states_end(bench: Bench, reads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    left = iter(range(reads))

    def joint_positions(arm: FakeArm) -> FloatArray:
        if next(left, None) is None:
            raise PortError("joint 'panda_joint1' is not in the joint states")
        return np.array(arm.positions)

    monkeypatch.setattr(FakeArm, "joint_positions", joint_positions)
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert "panda_joint1" in result.message
    assert len(bench.arm.sent) == max(reads - 1, 0)


@pytest.mark.parametrize("number", range(6))
def test_nothing_is_sent_from_elsewhere(bench: Bench, number: int) -> None:
    """The arm did not end where the motion led: the next one begins too far away."""

    def push(motion: int, share: float) -> None:
        if motion == number and share == 1.0:
            bench.arm.sent[-1].positions[-1] += 0.1

    bench.arm.on_step = push
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert "was not sent: the arm is 0.100 rad away" in result.message
    assert len(bench.arm.sent) == number + 1


@pytest.mark.parametrize(("width", "outcome"), [(0.003, Outcome.GRASP_MISSED), (0.008, Outcome.SUCCEEDED)])
def test_fingers_that_are_nearly_closed_hold_nothing(bench: Bench, width: float, outcome: Outcome) -> None:
    bench.gripper.object_width = width
    assert bench.run().outcome is outcome


def test_grasp_missed(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.gripper.object_width = 0.0
    opened_in: list[Phase] = []
    move = bench.gripper.move

    def noted(width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        opened_in.append(bench.phases[-1][0])
        return move(width, max_effort, should_stop)

    monkeypatch.setattr(bench.gripper, "move", noted)
    result = bench.run()
    assert result.outcome is Outcome.GRASP_MISSED
    assert "closed on nothing" in result.message
    assert opened_in[-1] is Phase.RETREAT, "the fingers open on the way back"
    assert Phase.CARRY not in bench.entered()
    assert result.gripper_width > 0.04
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)  # out of the view


def test_grasp_missed_when_it_slips_out_at_once(bench: Bench) -> None:
    def slip(motion: int, share: float) -> None:
        if motion == MOTIONS.index(Phase.RAISE) and share > 0.5:
            bench.gripper.lose_object()

    bench.arm.on_step = slip
    result = bench.run()
    assert result.outcome is Outcome.GRASP_MISSED
    assert "slipped out" in result.message
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)


def test_grasp_missed_says_when_the_way_out_fails(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.gripper.object_width = 0.0
    planned = bench.runner.planner.homeward

    def lost(*arguments: object) -> None:
        raise PortError("the joint states stopped")

    monkeypatch.setattr(bench.runner.planner, "homeward", lost)
    assert planned is not None
    result = bench.run()
    assert result.outcome is Outcome.GRASP_MISSED
    assert result.message.endswith("the arm stays where it is: the joint states stopped")


@pytest.mark.parametrize("phase", [Phase.CARRY, Phase.LOWER])
@pytest.mark.parametrize("share_lost", [0.4, 1.0])
@pytest.mark.parametrize("opens", [False, True])
def test_dropped(bench: Bench, phase: Phase, share_lost: float, opens: bool) -> None:
    """The fingers close because it slips out, or somebody opens them."""
    number = MOTIONS.index(phase)

    def slip(motion: int, share: float) -> None:
        if motion == number and share >= share_lost and bench.gripper.opening == 0.04:
            bench.gripper.lose_object()
            if opens:
                bench.gripper.opening = 0.08

    bench.arm.on_step = slip
    result = bench.run()
    assert result.outcome is Outcome.DROPPED
    assert result.message == f"the object was lost during {phase.name.lower()}"
    assert len(bench.arm.sent) == number + 2  # the one that was stopped, and the way home
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)
    assert bench.gripper.opening == 0.08


@pytest.mark.parametrize("phase", PICK_PLACE_PHASES)
def test_cancelled_as_a_phase_begins_sends_nothing_more(
    bench: Bench, phase: Phase, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_cancel: list[tuple[int, int]] = []

    def on_phase(entered: Phase, progress: float) -> None:
        if entered is phase and not bench.stop:
            bench.stop = True
            at_cancel.append(bench.commands)

    monkeypatch.setattr(bench, "on_phase", on_phase)
    result = bench.run()
    assert result.outcome is Outcome.CANCELLED
    assert "cancelled" in result.message
    assert at_cancel == [bench.commands]


@pytest.mark.parametrize("number", range(7))
def test_cancelled_while_the_arm_moves(bench: Bench, number: int) -> None:
    def on_step(motion: int, share: float) -> None:
        bench.stop = bench.stop or (motion == number and share >= 0.5)

    bench.arm.on_step = on_step
    result = bench.run()
    assert result.outcome is Outcome.CANCELLED
    assert result.message == f"cancelled during {MOTIONS[number].name.lower()}; the arm holds"
    assert bench.commands == (number + 1, (0, 0, 2, 2, 2, 3, 3)[number] + (number == 1))
    start, here, end = (*bench.arm.sent[-1].positions[[0, -1]], bench.arm.positions)
    assert np.abs(end - start).max() > 0
    assert np.abs(end - here).max() > 0
    if number in (2, 3, 4):
        assert bench.gripper.opening == 0.04  # what is held stays held


class StoppingGripper(FakeGripper):
    """Calls `on_move` with the number of the motion just before it begins."""

    on_move: Callable[[int], None] = staticmethod(lambda number: None)

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        self.on_move(len(self.moves))
        return super().move(width, max_effort, should_stop)


@pytest.mark.parametrize(("number", "motions"), [(0, 1), (1, 2), (2, 5)])
def test_cancelled_while_the_fingers_move(
    planner: TransferPlanner, table_cloud: np.ndarray, number: int, motions: int
) -> None:
    arm, gripper = FakeArm(), StoppingGripper(opening=0.0)
    bench = Bench(PickPlaceRunner(planner.model, planner, arm, gripper), arm, gripper, table_cloud, [])

    def on_move(move: int) -> None:
        bench.stop = bench.stop or move == number

    gripper.on_move = on_move
    assert bench.run().outcome is Outcome.CANCELLED
    assert bench.commands == (motions, number + 1)


@pytest.mark.parametrize("outcome", [Outcome.GRASP_MISSED, Outcome.DROPPED])
def test_cancelled_on_the_way_home(bench: Bench, outcome: Outcome) -> None:
    """The way home after a failure is a motion like any other."""
    if outcome is Outcome.GRASP_MISSED:
        bench.gripper.object_width = 0.0
    home = {Outcome.GRASP_MISSED: 3, Outcome.DROPPED: 4}[outcome]

    def on_step(motion: int, share: float) -> None:
        if outcome is Outcome.DROPPED and motion == 3 and bench.gripper.opening == 0.04:
            bench.gripper.lose_object()
        bench.stop = bench.stop or (motion == home and share > 0.5)

    bench.arm.on_step = on_step
    result = bench.run()
    assert result.outcome is Outcome.CANCELLED
    assert len(bench.arm.sent) == home + 1
