"""Every way in which a request ends, over an arm and a gripper that obey at once."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import PortError
from panda_executor.phase import Phase
from panda_executor.ports import GripperResult, MotionResult, MotionStatus, ShouldStop
from panda_executor.runner import PickPlaceRunner
from panda_executor.trajectory import JointTrajectory
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray, load_preset

READY_POSITIONS = load_preset().ready

PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)
GOAL = ActionGoal(PickPlaceAction(PICK, PLACE))
MOTIONS = (
    Phase.GO_ABOVE_PICK, Phase.DESCEND, Phase.RAISE, Phase.CARRY, Phase.LOWER, Phase.RETREAT, Phase.RETREAT,
)  # fmt: skip
PICK_PLACE_PHASES = tuple(Phase)[: Phase.DONE]


@dataclass
class Bench:
    """A runner with fakes, and what it said."""

    runner: PickPlaceRunner
    arm: FakeArm
    gripper: FakeGripper
    cloud: np.ndarray
    phases: list[tuple[Phase, float]]
    stop: bool = False

    def run(self, goal: ActionGoal = GOAL, cloud: np.ndarray | None = None) -> ActionResult:
        result = self.runner.run(
            goal, self.cloud if cloud is None else cloud, WorkspaceSpec(), self.on_phase, lambda: self.stop
        )
        assert result.message
        assert "\n" not in result.message
        return result

    def on_phase(self, phase: Phase, progress: float) -> None:
        self.phases.append((phase, progress))

    @property
    def commands(self) -> tuple[int, int]:
        """Number of trajectories and finger motions that were sent."""
        return len(self.arm.sent), len(self.gripper.moves)

    def entered(self) -> list[Phase]:
        order = [phase for phase, _ in self.phases]
        return [p for i, p in enumerate(order) if i == 0 or order[i - 1] is not p]


@pytest.fixture
def bench(planner: TransferPlanner, table_cloud: np.ndarray) -> Bench:
    arm, gripper = FakeArm(), FakeGripper(opening=0.02, object_width=0.0)
    gripper.opening, gripper.object_width = 0.02, 0.04
    return Bench(PickPlaceRunner(planner.model, planner, arm, gripper), arm, gripper, table_cloud, [])


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
        if bench.gripper.opening > 0.01 or width < 0.01:
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
    assert pytest.approx(result.gripper_width) == 0.02
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
    assert "not seen to stand still" in result.message and "holds" not in result.message
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
    arm, gripper = FakeArm(), StoppingGripper(opening=0.02)
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
