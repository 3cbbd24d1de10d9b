"""Every way in which a goal of the hand ends, over an arm and a gripper that obey at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper
from synthetic_clouds import Cube, cloud_of

from cliport_core.action import HandGoal
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import RequestError
from panda_executor.ik import hand_down_pose, tilted
from panda_executor.phase import Phase
from panda_executor.ports import MotionResult, MotionStatus
from panda_executor.runner import PickPlaceRunner
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

DOWN = hand_down_pose(0.45, 0.1, 0.3, 0.0)
LEANING = tilted(DOWN, 0.6)
GOAL = HandGoal(LEANING, blind=True)
COLUMN = Cube(0.45, 0.1, size=(0.08, 0.08, 0.35))


@dataclass
class Bench:
    """A runner with fakes; clouds are those that it fetches, one after the other, the last one again and again."""

    runner: PickPlaceRunner
    arm: FakeArm = field(default_factory=FakeArm)
    clouds: list[Any] = field(default_factory=lambda: [None])
    phases: list[Phase] = field(default_factory=list)
    plans: list[Any] = field(default_factory=list)
    stop: Callable[[], bool] = lambda: False
    approve: Callable[[], bool] = lambda: False

    def run(self, goal: HandGoal = GOAL) -> ActionResult:
        result = self.runner.move_hand(
            goal, self._cloud, WorkspaceSpec(), lambda phase, _: self.phases.append(phase), self.stop, self._on_plan
        )
        assert result.message and "\n" not in result.message
        return result

    def _cloud(self) -> Any:
        return self.clouds.pop(0) if len(self.clouds) > 1 else self.clouds[0]

    def _on_plan(self, motions: Any) -> bool:
        self.plans.append(motions)
        return self.approve()

    def tcp(self) -> Pose:
        return self.runner.planner.model.tcp_pose(self.arm.positions)


@pytest.fixture
def bench(planner: TransferPlanner) -> Bench:
    arm = FakeArm()
    return Bench(PickPlaceRunner(planner.model, planner, arm, FakeGripper(opening=0.0)), arm)


def test_the_hand_goes_where_it_is_told(bench: Bench) -> None:
    result = bench.run()
    assert result.outcome is Outcome.SUCCEEDED, result.message
    assert bench.tcp().is_close(LEANING, 1e-4)
    assert bench.phases == [Phase.VALIDATING, Phase.GRASP_PLANNING, Phase.CARRY, Phase.DONE]
    [[motion]], [trajectory] = bench.plans, bench.arm.sent
    assert np.array_equal(motion.trajectory.positions[-1], trajectory.positions[-1])
    assert result.gripper_width == 0.0


def test_a_plan_alone_moves_nothing(bench: Bench) -> None:
    result = bench.run(replace(GOAL, plan_only=True))
    assert (result.outcome, bench.arm.sent) == (Outcome.PLANNED, [])
    assert len(bench.plans) == 1


@pytest.mark.parametrize(
    ("goal", "refusal", "words"),
    [
        (replace(GOAL, target=hand_down_pose(1.2, 0.0, 0.3, 0.0)), Refusal.OUT_OF_REACH, "(1.200, 0.000, 0.300) m is"),
        (replace(GOAL, carried=0.31), Refusal.MALFORMED, "carried is 0.31 m, at most 0.3"),
    ],
)
def test_what_cannot_be_done_is_refused(bench: Bench, goal: HandGoal, refusal: Refusal, words: str) -> None:
    result = bench.run(goal)
    assert (result.outcome, result.refusal, bench.arm.sent) == (Outcome.REJECTED, refusal, [])
    assert words in result.message


def test_a_refusal_carries_its_numbers(bench: Bench) -> None:
    result = bench.run(replace(GOAL, carried=0.31))
    assert (result.refusal_value, result.refusal_limit) == (0.31, 0.3)


@pytest.mark.parametrize(("carried", "z", "passes"), [(0.0, 0.12, True), (0.15, 0.12, False), (0.15, 0.16, True)])
def test_what_is_carried_stays_off_the_table(bench: Bench, carried: float, z: float, passes: bool) -> None:
    result = bench.run(HandGoal(hand_down_pose(0.45, 0.1, z, 0.0), carried, blind=True))
    assert (result.outcome is Outcome.SUCCEEDED) is passes, result.message
    assert bool(bench.arm.sent) is passes


def test_what_is_carried_stays_off_the_arm(bench: Bench) -> None:
    close = hand_down_pose(0.3, 0.0, 0.6, 0.0)
    assert bench.run(HandGoal(close, 0.05, blind=True)).outcome is Outcome.SUCCEEDED
    result = bench.run(HandGoal(hand_down_pose(0.25, 0.0, 0.5, 0.0), 0.3, blind=True))
    assert result.outcome is Outcome.PLANNING_FAILED and "would touch the arm" in result.message


def test_a_pose_in_the_table_is_no_goal(bench: Bench) -> None:
    result = bench.run(replace(GOAL, target=hand_down_pose(0.45, 0.1, -0.02, 0.0)))
    assert (result.outcome, bench.arm.sent) == (Outcome.PLANNING_FAILED, [])


def test_what_is_seen_is_avoided(bench: Bench) -> None:
    bench.clouds = [cloud_of([COLUMN])]
    result = bench.run(HandGoal(DOWN))
    assert (result.outcome, bench.arm.sent) == (Outcome.PLANNING_FAILED, [])
    assert "touch what stands near" in result.message
    bench.clouds = [cloud_of([])]
    assert bench.run(HandGoal(DOWN)).outcome is Outcome.SUCCEEDED


def test_a_table_that_is_elsewhere_is_refused(bench: Bench) -> None:
    bench.clouds = [cloud_of([]) + np.array([0.0, 0.0, 0.02], np.float32)]
    result = bench.run(HandGoal(DOWN))
    assert (result.outcome, result.refusal) == (Outcome.REJECTED, Refusal.TABLE_HEIGHT)


def test_a_cloud_that_holds_nothing_is_refused(bench: Bench) -> None:
    bench.clouds = [np.full((9, 3), np.nan, np.float32)]
    assert bench.run(HandGoal(DOWN)).refusal is Refusal.NO_CLOUD


def test_what_came_while_the_plan_waited_is_avoided(bench: Bench) -> None:
    bench.clouds, bench.approve = [cloud_of([]), cloud_of([COLUMN])], lambda: True
    result = bench.run(HandGoal(DOWN))
    assert (result.outcome, bench.arm.sent) == (Outcome.PLANNING_FAILED, [])
    assert "the scene changed while the plan waited for its approval" in result.message
    bench.clouds = [cloud_of([]), cloud_of([])]
    assert bench.run(HandGoal(DOWN)).outcome is Outcome.SUCCEEDED


def test_a_plan_that_is_not_approved_moves_nothing(bench: Bench) -> None:
    def refuse() -> bool:
        raise RequestError("not approved", Refusal.NOT_APPROVED)

    bench.approve = refuse
    result = bench.run()
    assert (result.outcome, result.refusal, bench.arm.sent) == (Outcome.REJECTED, Refusal.NOT_APPROVED, [])


def test_a_stop_ends_it_where_it_is(bench: Bench) -> None:
    asked = False

    def half_way(_: int, share: float) -> None:
        nonlocal asked
        asked = asked or share > 0.5

    bench.arm.on_step, bench.stop = half_way, lambda: asked
    result = bench.run()
    assert (result.outcome, len(bench.arm.sent)) == (Outcome.CANCELLED, 1)
    assert result.message == "cancelled during carry; the arm holds"


def test_after_a_failure_the_arm_stays(bench: Bench) -> None:
    bench.arm.fail_at, bench.arm.failure = 0, MotionResult(MotionStatus.ABORTED, "path tolerance violated")
    result = bench.run()
    assert (result.outcome, len(bench.arm.sent)) == (Outcome.EXECUTION_FAILED, 1)
    assert "path tolerance violated" in result.message


def test_joint_states_that_are_none_are_refused(bench: Bench) -> None:
    bench.arm.positions = load_preset().ready * np.nan
    assert bench.run().refusal is Refusal.JOINT_STATES
