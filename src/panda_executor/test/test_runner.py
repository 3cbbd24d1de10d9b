"""Requests over an arm and a gripper that obey at once: carried out, planned alone, or refused."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from runner_bench import GOAL, PICK, PICK_PLACE_PHASES, PLACE, READY_POSITIONS, Bench, runner_bench

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.phase import Phase
from panda_executor.ports import GripperResult, MotionResult, MotionStatus, ShouldStop
from panda_executor.trajectory import JointTrajectory
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray


@pytest.fixture(scope="session")
def planner(planned_once: TransferPlanner) -> TransferPlanner:
    return planned_once


@pytest.fixture
def bench(planner: TransferPlanner, table_cloud: np.ndarray) -> Bench:
    return runner_bench(planner, table_cloud)


def test_succeeded(bench: Bench) -> None:
    result = bench.run()
    assert result.outcome is Outcome.SUCCEEDED, result.message
    assert bench.commands == (7, 3)
    assert bench.entered() == [*PICK_PLACE_PHASES, Phase.DONE]
    progress = [share for _, share in bench.phases]
    assert progress == sorted(progress)
    assert (progress[0], progress[-1]) == (0.0, 1.0)
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)
    assert result.grasp_centroid is not None
    np.testing.assert_allclose(result.grasp_centroid[:2], [0.45, 0.1], atol=0.003)
    opened, closed, released = bench.gripper.moves
    assert closed == 0.0
    assert opened > 0.04 < released
    assert result.gripper_width == pytest.approx(released)


def test_planned_moves_nothing(bench: Bench) -> None:
    result = bench.run(replace(GOAL, plan_only=True))
    assert result.outcome is Outcome.PLANNED
    assert "7 motions" in result.message
    assert bench.commands == (0, 0)
    assert result.grasp_centroid is not None


@pytest.mark.parametrize("primitive", [Primitive.SWEEP, Primitive.FOLD])
@pytest.mark.parametrize("plan_only", [False, True])
def test_drags(bench: Bench, primitive: Primitive, plan_only: bool) -> None:
    action = PickPlaceAction(PlanarPose(0.35, 0.0, 0.0), PlanarPose(0.35, 0.2, 0.0), primitive)
    result = bench.run(ActionGoal(action, plan_only=plan_only))
    assert result.outcome is (Outcome.PLANNED if plan_only else Outcome.SUCCEEDED), result.message
    assert primitive.name.lower() in result.message
    motions = 6 if primitive is Primitive.FOLD else 5  # a fold has a small lift
    assert len(bench.arm.sent) == (0 if plan_only else motions)


FOLD = ActionGoal(PickPlaceAction(PlanarPose(0.35, 0.0, 0.0), PlanarPose(0.35, 0.2, 0.0), Primitive.FOLD))


def test_a_fold_that_holds_nothing_goes_up_again_and_home(bench: Bench) -> None:
    bench.gripper.object_width = 0.0
    result = bench.run(FOLD)
    assert result.outcome is Outcome.GRASP_MISSED, result.message
    assert "closed on nothing" in result.message
    assert len(bench.arm.sent) == 4  # above, down, up, home
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)
    assert bench.gripper.moves[-1] == bench.runner.config.hand.fold_opening


def test_a_fold_lets_go_among_neighbours(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.gripper.object_width = 0.01
    free = bench.gripper.move

    def move(width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        if bench.gripper.opening != 0.01 or width < 0.01:
            return free(width, max_effort, should_stop)
        bench.gripper.opening = 0.014
        return GripperResult(0.014, False, False, MotionStatus.ABORTED, "the fingers did not settle")

    monkeypatch.setattr(bench.gripper, "move", move)
    result = bench.run(FOLD)
    assert result.outcome is Outcome.SUCCEEDED, result.message


def test_a_fold_that_loses_its_bead_says_so(bench: Bench) -> None:
    def lose(motion: int, share: float) -> None:
        if motion == 3 and share > 0.5:
            bench.gripper.lose_object()

    bench.arm.on_step = lose
    result = bench.run(FOLD)
    assert result.outcome is Outcome.DROPPED and "carry" in result.message
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (PickPlaceAction(PlanarPose(0.9, 0.1, 0.0), PLACE), r"the pick \(0\.900, 0\.100\) m is outside the workspace"),
        (PickPlaceAction(PICK, PlanarPose(0.5, -0.41, 0.0)), r"the place .* y -0\.4\.\.0\.4 m"),
        (PickPlaceAction(PlanarPose(math.nan, 0.1, 0.0), PLACE), "the pick pose is not finite"),
        (PickPlaceAction(PICK, PlanarPose(0.5, 0.0, math.inf)), "the place pose is not finite"),
    ],
)
@pytest.mark.parametrize("primitive", list(Primitive))
def test_rejected_requests(bench: Bench, action: PickPlaceAction, words: str, primitive: Primitive) -> None:
    result = bench.run(ActionGoal(replace(action, primitive=primitive)))
    assert result.outcome is Outcome.REJECTED
    assert pytest.approx(result.gripper_width) == 0.0
    assert bench.commands == (0, 0)
    assert re.search(words, result.message), result.message


@pytest.mark.parametrize(
    ("cloud", "words"),
    [(np.zeros((4, 4), np.float32), "shape (N, 3)"), (np.full((9, 3), np.nan, np.float32), "no valid point")],
)
def test_rejected_clouds(bench: Bench, cloud: np.ndarray, words: str) -> None:
    result = bench.run(cloud=cloud)
    assert (result.outcome, bench.commands) == (Outcome.REJECTED, (0, 0))
    assert words in result.message


def test_rejected_joint_positions(bench: Bench) -> None:
    bench.arm.positions = np.full(7, np.nan)
    result = bench.run()
    assert (result.outcome, bench.commands) == (Outcome.REJECTED, (0, 0))
    assert "seven finite numbers" in result.message


def test_rejected_out_of_reach(bench: Bench) -> None:
    far = replace(WorkspaceSpec(), x_max=1.2)
    action = PickPlaceAction(PICK, PlanarPose(1.1, 0.0, 0.0))
    result = bench.runner.run(ActionGoal(action), bench.cloud, far)
    assert (result.outcome, bench.commands) == (Outcome.REJECTED, (0, 0))
    assert "the place (1.100, 0.000) m is out of reach" in result.message


def test_planning_failed(bench: Bench) -> None:
    result = bench.run(ActionGoal(PickPlaceAction(PlanarPose(0.6, 0.3, 0.0), PLACE)))
    assert (result.outcome, bench.commands) == (Outcome.PLANNING_FAILED, (0, 0))
    assert "nothing rises" in result.message


@pytest.mark.parametrize("goal", [GOAL, FOLD])
def test_motions_begin_where_the_arm_is_measured(bench: Bench, goal: ActionGoal) -> None:
    """Every motion ends a little off: each next one begins there, and the last one still ends at the ready pose."""

    def sag(motion: int, share: float) -> None:
        if share == 0.0 and motion > 0:
            np.testing.assert_allclose(bench.arm.sent[-1].positions[0], bench.arm.positions, atol=1e-9)
        if share == 1.0 and bench.arm.sent[-1] is not ends[-1]:
            ends.append(bench.arm.sent[-1])
            planned.append(np.array(ends[-1].positions[-1]))
            bench.arm.sent[-1].positions[-1] += [0.004, -0.003, 0.0, 0.002, 0.0, -0.004, 0.003]

    ends: list[JointTrajectory | None] = [None]
    planned: list[FloatArray] = []
    bench.arm.on_step = sag
    bench.gripper.object_width = 0.03
    result = bench.run(goal)
    assert result.outcome is Outcome.SUCCEEDED, result.message
    np.testing.assert_allclose(planned[-1], READY_POSITIONS, atol=1e-6)


@pytest.mark.parametrize(("off", "outcome"), [(0.05, Outcome.SUCCEEDED), (0.2, Outcome.EXECUTION_FAILED)])
def test_a_fold_goes_on_where_objects_push_the_arm_off_a_little(bench: Bench, off: float, outcome: Outcome) -> None:
    bench.gripper.object_width = 0.01
    bench.arm.fail_at, bench.arm.failure = 1, MotionResult(MotionStatus.OFF_GOAL, "goal tolerance violated")
    bench.arm.fail_share = 1.0

    def push(motion: int, share: float) -> None:
        if motion == 1 and share == 1.0:
            bench.arm.positions = bench.arm.sent[-1].positions[-1] + np.array([off, 0, 0, 0, 0, 0, 0])

    bench.arm.on_step = push
    result = bench.run(FOLD)
    assert result.outcome is outcome, result.message


def test_the_arm_goes_ready_from_anywhere(bench: Bench) -> None:
    bench.arm.positions = READY_POSITIONS + 0.2
    assert bench.runner.go_ready().outcome is Outcome.SUCCEEDED
    np.testing.assert_allclose(bench.arm.positions, READY_POSITIONS, atol=1e-6)
    assert bench.runner.go_ready().outcome is Outcome.SUCCEEDED  # when it is there already, too
    bench.arm.positions = READY_POSITIONS + 0.2
    sent = len(bench.arm.sent)
    assert bench.runner.go_ready(lambda: True).outcome is Outcome.CANCELLED
    assert len(bench.arm.sent) == sent


def test_two_requests_in_a_row(bench: Bench) -> None:
    assert bench.run().outcome is Outcome.SUCCEEDED
    bench.gripper.opening = 0.02
    assert bench.run().outcome is Outcome.SUCCEEDED
    assert bench.commands == (14, 6)
