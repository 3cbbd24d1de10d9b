"""The way back after a failure, what the hand holds after any end, and approval."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.new_id import new_id
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.approvals import Approvals
from panda_executor.config import AfterFailure
from panda_executor.errors import RequestError
from panda_executor.hand_geometry import HandShape
from panda_executor.motions import Motion
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.owner_watch import OwnerWatch
from panda_executor.ports import GripperResult, MotionResult, MotionStatus, ShouldStop
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

READY = load_preset().ready
GOAL = ActionGoal(PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)))


@pytest.fixture(scope="session")
def planner(planned_once: TransferPlanner) -> TransferPlanner:
    return planned_once


class Bench:
    """A runner that goes back after failures as `rule` says."""

    def __init__(self, planner: TransferPlanner, cloud: np.ndarray, rule: AfterFailure) -> None:
        self.arm, self.gripper, self.cloud = FakeArm(), FakeGripper(opening=0.0), cloud
        config = replace(planner.config, after_failure=rule)
        self.runner = PickPlaceRunner(planner.model, planner, self.arm, self.gripper, config)
        self.stop = False

    def run(self) -> ActionResult:
        return self.runner.run(GOAL, self.cloud, WorkspaceSpec(), should_stop=lambda: self.stop)

    @property
    def is_home(self) -> bool:
        return bool(np.abs(self.arm.positions - READY).max() < 1e-6)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
@pytest.mark.parametrize("rule", [AfterFailure.KEEP, AfterFailure.OPEN])
def test_the_arm_goes_back_after_an_abort(
    planner: TransferPlanner, table_cloud: np.ndarray, rule: AfterFailure, number: int
) -> None:
    bench = Bench(planner, table_cloud, rule)
    bench.arm.fail_at = number
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert "path tolerance violated" in result.message and "went back to its ready pose" in result.message
    assert bench.is_home
    held = number > 1 and rule is AfterFailure.KEEP
    assert (bench.gripper.opening == 0.04) is held


def test_a_gripper_that_fails_does_not_leave_the_arm_there(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.gripper.failure = GripperResult(math.nan, False, False, MotionStatus.ABORTED, "jammed")
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED and "jammed" in result.message
    assert bench.is_home


@pytest.mark.parametrize("number", [1, 3])
def test_a_stop_by_somebody_else_is_not_answered_by_a_motion(
    planner: TransferPlanner, table_cloud: np.ndarray, number: int
) -> None:
    """The guard, the simulator or a person cancelled at the controller; the executor was asked nothing."""
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.arm.fail_at, bench.arm.failure = number, MotionResult(MotionStatus.CANCELLED, "cancelled")
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED
    assert "somebody else cancelled it; look, then call /panda_executor/recover" in result.message
    assert len(bench.arm.sent) == number + 1


def test_a_stop_of_the_fingers_is_not_answered_by_a_motion(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.gripper.failure = GripperResult(math.nan, False, False, MotionStatus.CANCELLED)
    assert "somebody else cancelled it" in bench.run().message
    assert len(bench.arm.sent) == 1


def test_a_stop_of_the_escape_is_not_followed_by_another_try(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.gripper.object_width = 0.0
    bench.arm.fail_at, bench.arm.failure = 2, MotionResult(MotionStatus.CANCELLED)
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED, "GRASP_MISSED would be tried again"
    assert "the fingers closed on nothing; the arm's motion cancelled during retreat" in result.message
    assert len(bench.arm.sent) == 3


class StubbornGripper(FakeGripper):
    """Its moves number `at` and later end with `status`; it closes all the same, and does not open."""

    at, status = 1, MotionStatus.ABORTED

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        if len(self.moves) < self.at or width == 0.0:
            result = super().move(width, max_effort, should_stop)
            return result if len(self.moves) <= self.at else replace(result, status=self.status, message="stuck")
        self.moves.append(width)
        return GripperResult(self.opening, False, False, self.status, "stuck")


@pytest.mark.parametrize(("at", "words"), [(1, "stuck"), (2, "stuck")])
def test_what_a_failing_gripper_holds_is_not_forgotten(
    planner: TransferPlanner, table_cloud: np.ndarray, at: int, words: str
) -> None:
    """It closed round the object and aborted, or did not open: the next goal used to drop the object from above."""
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    gripper = StubbornGripper(opening=0.0)
    gripper.at = at
    bench.gripper = gripper
    bench.runner = PickPlaceRunner(planner.model, planner, bench.arm, gripper, bench.runner.config)
    result = bench.run()
    assert result.outcome is Outcome.EXECUTION_FAILED and words in result.message
    assert bench.is_home and gripper.opening == 0.04
    sent = len(bench.arm.sent)
    assert bench.run().refusal is Refusal.HAND_NOT_EMPTY
    assert len(bench.arm.sent) == sent


def test_a_miss_is_told_with_what_failed_after_it(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    gripper = StubbornGripper(opening=0.0, object_width=0.0)
    gripper.at = 2
    bench.runner = PickPlaceRunner(planner.model, planner, bench.arm, gripper, bench.runner.config)
    result = bench.run()
    assert result.outcome is Outcome.GRASP_MISSED
    assert "the fingers closed on nothing; the gripper's motion aborted: stuck" in result.message
    assert bench.is_home


def test_what_is_held_is_carried_back_in_its_own_shape(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    """`recover` without a goal used to check the empty hand, also with an object in it."""
    bench = Bench(planner, table_cloud, AfterFailure.STAY)
    bench.arm.fail_at = 3
    assert bench.run().outcome is Outcome.EXECUTION_FAILED
    shapes = []
    plan_home = planner.homeward

    def homeward(start: np.ndarray, grid: ObstacleGrid, hand: HandShape) -> Motion:
        shapes.append(hand)
        return plan_home(start, grid, hand)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(planner, "homeward", homeward)
        assert bench.runner.recover().outcome is Outcome.SUCCEEDED
    assert len(shapes[0].load) and bench.is_home


def test_the_share_done_does_not_jump_on_the_way_back(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.arm.fail_at = 3
    shares: list[float] = []
    bench.runner.run(GOAL, table_cloud, WorkspaceSpec(), lambda phase, share: shares.append(share))
    assert shares == sorted(shares) and shares[-1] < 1.0


@pytest.mark.parametrize(
    "failure",
    [MotionResult(MotionStatus.UNAVAILABLE, "gone"), MotionResult(MotionStatus.ABORTED, "lost", standing=False)],
)
def test_an_arm_that_may_still_move_is_not_sent_anywhere(
    planner: TransferPlanner, table_cloud: np.ndarray, failure: MotionResult
) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.arm.fail_at, bench.arm.failure = 1, failure
    assert bench.run().outcome is Outcome.EXECUTION_FAILED
    assert len(bench.arm.sent) == 2


def test_a_stop_on_the_way_back_holds_the_arm(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.arm.fail_at = 1

    def stop(motion: int, share: float) -> None:
        bench.stop = bench.stop or (motion == 2 and share > 0.3)

    bench.arm.on_step = stop
    result = bench.run()
    assert result.outcome is Outcome.CANCELLED
    assert len(bench.arm.sent) == 3 and not bench.is_home


def test_nothing_goes_back_that_did_not_move(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    bench.arm.positions = READY + 0.001
    bench.stop = True
    assert bench.run().outcome is Outcome.CANCELLED
    assert bench.arm.sent == []


def test_a_hand_that_holds_something_takes_nothing_else(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    """A cancel in mid-carry used to be followed by a goal that assumed an empty hand."""
    bench = Bench(planner, table_cloud, AfterFailure.STAY)

    def stop(motion: int, share: float) -> None:
        bench.stop = motion == 3 and share > 0.5

    bench.arm.on_step = stop
    assert bench.run().outcome is Outcome.CANCELLED
    bench.stop, bench.arm.on_step = False, lambda motion, share: None
    sent = len(bench.arm.sent)
    refused = bench.run()
    assert (refused.outcome, refused.refusal) == (Outcome.REJECTED, Refusal.HAND_NOT_EMPTY)
    assert refused.refusal_value == pytest.approx(0.04) and "40 mm wide" in refused.message
    assert len(bench.arm.sent) == sent
    assert bench.runner.recover().outcome is Outcome.SUCCEEDED
    assert bench.is_home and bench.gripper.opening == 0.04
    assert bench.run().refusal is Refusal.HAND_NOT_EMPTY
    assert bench.runner.open().outcome is Outcome.SUCCEEDED
    bench.gripper.object_width = 0.04
    assert bench.run().outcome is Outcome.SUCCEEDED


def test_opening_lets_go_of_what_is_as_wide_as_the_open_hand(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    """The fingers need not move for it, and used to count as closed on it for ever."""
    bench = Bench(planner, table_cloud, AfterFailure.STAY)
    bench.gripper.opening = planner.config.hand.opening
    bench.runner._hand.note(0.0, bench.gripper.opening)
    assert bench.run().refusal is Refusal.HAND_NOT_EMPTY
    assert bench.runner.open().outcome is Outcome.SUCCEEDED and not bench.gripper.moves
    assert bench.run().outcome is Outcome.SUCCEEDED


def test_an_approval_is_of_one_plan() -> None:
    approvals = Approvals(10.0)
    assert approvals.approve("whatever") == (False, "no plan waits for approval")
    first, second = new_id(), new_id()
    approvals.offer(first)
    approvals.offer(second)
    assert not approvals.approve(first)[0], "an approval of another plan"
    assert not approvals.approve("")[0]
    assert approvals.approve(second)[0]
    approvals.wait(second, lambda: False)
    assert not approvals.approve(second)[0], "it was used up"


def test_an_approval_expires() -> None:
    now = iter(range(1000))
    approvals = Approvals(3.0, lambda: next(now))
    approvals.offer("a")
    with pytest.raises(RequestError, match="was not approved within 3 s") as caught:
        approvals.wait("a", lambda: False)
    assert caught.value.refusal is Refusal.NOT_APPROVED


def test_a_stop_ends_the_wait_for_an_approval() -> None:
    approvals = Approvals(1e9)
    approvals.offer("b")
    with pytest.raises(RequestError, match="plan b was not approved before a stop was asked for") as caught:
        approvals.wait("b", lambda: True)
    assert caught.value.refusal is Refusal.NOT_APPROVED
    assert approvals.approve("b") == (False, "no plan waits for approval")


def test_a_stop_that_is_taken_back_does_not_approve_a_plan(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    """Whoever asks for a stop while the plan waits may not ask any more when the first motion is sent."""
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)
    approvals, stops = Approvals(1e9), [False, True, False]

    def wait(_: object) -> bool:
        approvals.offer("b")
        approvals.wait("b", lambda: stops.pop(0))
        return True

    result = bench.runner.run(GOAL, table_cloud, WorkspaceSpec(), on_plan=wait)
    assert (result.outcome, result.refusal) == (Outcome.REJECTED, Refusal.NOT_APPROVED)
    assert bench.arm.sent == [] and bench.gripper.moves == []


def test_a_plan_that_nobody_approves_moves_nothing(planner: TransferPlanner, table_cloud: np.ndarray) -> None:
    bench = Bench(planner, table_cloud, AfterFailure.KEEP)

    def refuse(_: object) -> bool:
        raise RequestError("not approved", Refusal.NOT_APPROVED)

    result = bench.runner.run(GOAL, table_cloud, WorkspaceSpec(), on_plan=refuse)
    assert (result.outcome, result.refusal) == (Outcome.REJECTED, Refusal.NOT_APPROVED)
    assert bench.arm.sent == [] and bench.gripper.moves == []


def test_an_owner_that_falls_silent_is_noticed() -> None:
    now = [0.0]
    owners = OwnerWatch(lambda: now[0], longest=0.5)
    owners.begin("server-1")

    def pass_time(seconds: float, beats: str = "") -> bool:
        for _ in range(round(seconds / 0.01)):
            now[0] += 0.01
            if beats:
                owners.on_beat(beats)
            owners.is_silent("server-1")
        return owners.is_silent("server-1")

    assert not pass_time(3.0, beats="server-1")
    assert not pass_time(0.4)
    assert pass_time(0.2), "its death would not be noticed"
    owners.begin("server-1")
    assert pass_time(0.6, beats="another"), "another's signs of life are not its own"
    owners.begin("server-1")
    now[0] += 10.0  # this process's own pause
    assert not owners.is_silent("server-1")
    owners.begin("")
    now[0] += 10.0
    assert not owners.is_silent(""), "nobody is nobody's owner"
