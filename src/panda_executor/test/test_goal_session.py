"""One goal over a runner that is played: which clouds will do, and in which state the goal's handle ends."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ros_clouds import raw_cloud

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.messages import goal_to_msg, result_from_msg
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.action import PickPlace
from panda_executor.approvals import Approvals
from panda_executor.arm_watch import ArmWatch
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.config import ExecutorConfig
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.goal_session import GoalSession
from panda_executor.guard_watch import GuardWatch
from panda_executor.node_parameters import NodeParameters
from panda_executor.owned_runs import Watchers
from panda_executor.owner_watch import OwnerWatch
from panda_executor.phase import Phase
from panda_model import load_preset

S = 1_000_000_000
GOAL = ActionGoal(PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)), owner="tester")
LOGGER = logging.getLogger("test")


class Handle:
    """A goal's handle as rclpy's: it may only end as cancelled when a cancel was asked for."""

    def __init__(self) -> None:
        self.request = goal_to_msg(GOAL, "panda_link0")
        self.is_cancel_requested = False
        self.ended: list[str] = []

    def publish_feedback(self, feedback: Any) -> None:
        assert not self.ended

    def succeed(self) -> None:
        self.ended.append("succeeded")

    def abort(self) -> None:
        self.ended.append("aborted")

    def canceled(self) -> None:
        assert self.is_cancel_requested, "rclpy refuses this transition"
        self.ended.append("cancelled")


class Session:
    """A session at a time that the test sets; `act` is what the runner does, given should_stop."""

    def __init__(self, auto_approve: bool = True, approval_time: float = 30.0) -> None:
        self.now, self.gate, self.clouds = 10.0, Gate(), CloudCache()
        self.act: Callable[[Callable[[], bool]], Outcome] = lambda should_stop: Outcome.SUCCEEDED
        parameters = NodeParameters(
            load_preset("panda"), "", ExecutorConfig(), WorkspaceSpec(),
            max_cloud_age=2.0, max_joint_age=0.5, cloud_behind=0.0, cloud_wait=0.0, max_ahead=0.25,
            auto_approve=auto_approve, approval_time=approval_time, require_owner=True,
            guard_silence=3.0, self_clearance=0.03, watch=ArmWatch(),
            owner_silence=0.3, work_silence=0.25, cameras=1,
        )  # fmt: skip
        camera = CameraPlace("panda_link0")
        camera.put("panda_link0", "camera", Pose.identity())
        camera.see("camera")
        self.planner, self.camera_position = self, np.full(3, np.nan)
        self.approvals = Approvals(parameters.approval_time)
        self.steady = 10.0
        self.guard = GuardWatch(lambda: self.steady, parameters.guard_silence)
        self.guard.on_report()
        self._session = GoalSession(
            self, self.clouds, camera, parameters, self.gate, lambda: int(self.now * S),  # type: ignore[arg-type]
            Watchers(OwnerWatch(time.monotonic, 0.3), self.guard), self.approvals,
        )  # fmt: skip

    def run(
        self, request: Any, cloud: Any, workspace: Any, on_phase: Any, should_stop: Any, approve: Any, look: Any
    ) -> ActionResult:
        """The runner."""
        cloud()
        self.waited = approve([])
        self.on_phase, self.look = on_phase, look
        return ActionResult(self.act(should_stop), "the runner's words")

    def place_cameras(self, position: Any) -> None:
        """The runner's planner."""
        self.camera_position = position

    def see(self, stamp: float) -> None:
        self.clouds.put(raw_cloud(np.zeros((4, 3), np.float32), int(stamp * S)))

    def ask(self, handle: Handle | None = None) -> tuple[ActionResult, Handle]:
        handle = handle or Handle()
        result = result_from_msg(self._session.run(handle, LOGGER))  # type: ignore[arg-type]
        assert len(handle.ended) == 1
        return result, handle


@pytest.fixture
def session() -> Session:
    return Session()


def test_a_cloud_from_before_the_last_motions_end_is_rejected(session: Session) -> None:
    def move(_: Callable[[], bool]) -> Outcome:
        session.now += 5.0
        return Outcome.SUCCEEDED

    session.act = move
    session.see(9.9)
    assert session.ask()[0].outcome is Outcome.SUCCEEDED
    session.see(14.8)
    rejected, handle = session.ask()
    assert (rejected.outcome, handle.ended) == (Outcome.REJECTED, ["aborted"])
    assert "while the arm still moved" in rejected.message
    session.see(15.0)
    assert session.ask()[0].outcome is Outcome.SUCCEEDED


def test_a_plan_that_needs_no_approval_takes_none(session: Session) -> None:
    def approve(_: Callable[[], bool]) -> Outcome:
        assert session.approvals.approve("12345678") == (False, "no plan waits for approval")
        return Outcome.SUCCEEDED

    session.act = approve
    session.see(10.0)
    assert session.ask()[0].outcome is Outcome.SUCCEEDED


@pytest.mark.parametrize("plan_only", [False, True])
def test_a_plan_waits_for_its_approval_unless_nothing_is_to_move(plan_only: bool) -> None:
    session, handle, asked = Session(auto_approve=False), Handle(), []

    def hear(feedback: PickPlace.Feedback) -> None:
        if feedback.phase == PickPlace.Feedback.PHASE_APPROVAL:
            asked.append(session.approvals.approve(feedback.plan_id))

    handle.publish_feedback = hear  # type: ignore[method-assign]
    handle.request.plan_only = plan_only
    session.see(10.0)
    assert session.ask(handle)[0].outcome is Outcome.SUCCEEDED
    assert session.waited is not plan_only
    assert [ok for ok, _ in asked] == ([] if plan_only else [True])


def test_a_plan_that_nobody_approves_is_not_carried_out() -> None:
    session = Session(auto_approve=False, approval_time=0.05)
    session.act = lambda _: pytest.fail("it moved")
    session.see(10.0)
    refused, handle = session.ask()
    assert (refused.outcome, refused.refusal, handle.ended) == (Outcome.REJECTED, Refusal.NOT_APPROVED, ["aborted"])
    assert "was not approved within 0.05 s" in refused.message


def test_only_a_cloud_from_after_the_departure_is_looked_at(session: Session) -> None:
    looked: list[Any] = []

    def act(_: Callable[[], bool]) -> Outcome:
        for phase, stamp in ((Phase.GO_ABOVE_PICK, 12.0), (Phase.CARRY, 14.0)):
            session.now = stamp
            session.on_phase(phase, 0.1)
            session.see(stamp - 0.1)
            session.now = stamp + 0.5
            session.on_phase(phase, 0.2)
            with pytest.raises(
                RequestError, match=r"taken 0\.1 s before the arm last departed; has the camera stopped\?"
            ):
                session.look()
            session.see(stamp + 0.1)
            looked.append(session.look().shape)
        return Outcome.SUCCEEDED

    session.act = act
    session.see(10.0)
    assert session.ask()[0].outcome is Outcome.SUCCEEDED
    assert looked == [(4, 3), (4, 3)]


def test_a_motion_that_nobody_owns_is_refused(session: Session) -> None:
    session.see(10.0)
    unowned = Handle()
    unowned.request.owner = ""
    session.act = lambda _: pytest.fail("the runner was asked")
    refused, _ = session.ask(unowned)
    assert (refused.outcome, refused.refusal) == (Outcome.REJECTED, Refusal.NO_OWNER)
    assert "/cliport/owner_heartbeat" in refused.message
    session.act = lambda _: Outcome.PLANNED
    only_planned = Handle()
    only_planned.request.owner, only_planned.request.plan_only = "", True
    assert session.ask(only_planned)[0].outcome is Outcome.PLANNED


def test_a_motion_that_no_guard_watches_is_refused(session: Session) -> None:
    session.steady = 13.5
    session.see(10.0)
    session.act = lambda _: pytest.fail("the runner was asked")
    refused, _ = session.ask()
    assert (refused.outcome, refused.refusal) == (Outcome.REJECTED, Refusal.NO_GUARD)
    assert (refused.refusal_value, refused.refusal_limit) == (3.5, 3.0)
    session.act = lambda _: Outcome.PLANNED
    only_planned = Handle()
    only_planned.request.plan_only = True
    assert session.ask(only_planned)[0].outcome is Outcome.PLANNED
    session.guard.on_report()
    session.act = lambda _: Outcome.SUCCEEDED
    assert session.ask()[0].outcome is Outcome.SUCCEEDED


def test_a_motion_that_failed_counts_as_one(session: Session) -> None:
    def fail(_: Callable[[], bool]) -> Outcome:
        session.now += 1.0
        raise RuntimeError("the arm is lost")

    session.act = fail
    session.see(10.0)
    failed, handle = session.ask()
    assert (failed.outcome, handle.ended) == (Outcome.EXECUTION_FAILED, ["aborted"])
    assert "RuntimeError: the arm is lost" in failed.message
    session.act = lambda should_stop: Outcome.SUCCEEDED
    assert "while the arm still moved" in session.ask()[0].message


def test_a_stop_that_nobody_cancelled_ends_as_aborted(session: Session) -> None:
    def stopped(should_stop: Callable[[], bool]) -> Outcome:
        assert not should_stop()
        session.gate.latch("stopped on request")
        assert should_stop()
        return Outcome.CANCELLED

    session.act = stopped
    session.see(10.0)
    result, handle = session.ask()
    assert (result.outcome, handle.ended) == (Outcome.CANCELLED, ["aborted"])
    assert (result.message, result.refusal) == ("the runner's words", Refusal.NONE), "its owner lives"


def test_a_cancel_ends_as_cancelled(session: Session) -> None:
    asked = Handle()

    def cancelled(should_stop: Callable[[], bool]) -> Outcome:
        asked.is_cancel_requested = True
        assert should_stop()
        return Outcome.CANCELLED

    session.act = cancelled
    session.see(10.0)
    assert session.ask(asked)[1].ended == ["cancelled"]


@pytest.mark.parametrize("outcome", [Outcome.SUCCEEDED, Outcome.PLANNED, Outcome.GRASP_MISSED, Outcome.PLANNING_FAILED])
def test_other_ends_succeed_or_abort(session: Session, outcome: Outcome) -> None:
    session.act = lambda should_stop: outcome
    session.see(10.0)
    result, handle = session.ask()
    well = outcome in (Outcome.SUCCEEDED, Outcome.PLANNED)
    assert (result.outcome, handle.ended) == (outcome, ["succeeded" if well else "aborted"])


def test_each_goal_is_planned_around_the_camera_where_it_stands(session: Session) -> None:
    session.see(10.0)
    assert session.ask()[0].outcome is Outcome.SUCCEEDED
    np.testing.assert_array_equal(session.camera_position, np.zeros(3))
