"""A goal of the hand over a runner that is played: its cloud, its owner, its approval, and the handle's end."""

from __future__ import annotations

import logging
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cliport_interfaces.action")

from ros_clouds import raw_cloud

from cliport_core.action import HandGoal
from cliport_core.messages_hand import hand_goal_to_msg, hand_result_from_msg
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.action import MoveHand
from panda_executor.approvals import Approvals
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.gate import Gate
from panda_executor.goal_session import GoalSession
from panda_executor.guard_watch import GuardWatch
from panda_executor.owned_runs import Watchers
from panda_executor.owner_watch import OwnerWatch
from panda_executor.phase import Phase
from panda_model import load_preset

S = 1_000_000_000
GOAL = HandGoal(Pose.from_xyz_rpy((0.4, 0.1, 0.5), (3.0, 0.2, 0.1)), carried=0.16, blind=True, owner="me")


class Bench:
    """A session at ten seconds, its goal's handle and its runner at once."""

    def __init__(self, auto_approve: bool = True) -> None:
        self.request = hand_goal_to_msg(GOAL, "panda_link0")
        self.is_cancel_requested = False
        self.ended, self.feedback = list[str](), list[MoveHand.Feedback]()
        self.given: list[HandGoal] = []
        self.clouds_got, self.camera_at = list[Any](), list[Any]()
        self.gate, self.clouds, self.camera = Gate(), CloudCache(), CameraPlace("panda_link0")
        self.approvals = Approvals(0.05)
        self.guard = GuardWatch(lambda: 64.0, 0.0)
        self.planner = SimpleNamespace(place_cameras=self.camera_at.append)
        self.now = 10.0
        parameters: Any = SimpleNamespace(
            robot=load_preset(), workspace=WorkspaceSpec(), cloud_wait=0.0, auto_approve=auto_approve,
            require_owner=True, owner_silence=0.3, approval_time=0.05,
        )  # fmt: skip
        self.session = GoalSession(
            self, self.clouds, self.camera, parameters, self.gate, lambda: int(self.now * S),  # type: ignore[arg-type]
            Watchers(OwnerWatch(lambda: 64.0, 0.3), self.guard), self.approvals,
        )  # fmt: skip

    def move_hand(
        self, goal: HandGoal, cloud: Any, workspace: Any, on_phase: Any, should_stop: Any, on_plan: Any
    ) -> ActionResult:
        """The runner's."""
        self.given.append(goal)
        self.clouds_got.append(cloud())
        self.waited = on_plan([])
        on_phase(Phase.CARRY, 0.6)
        self.now += 5.0
        return ActionResult(Outcome.CANCELLED if should_stop() else Outcome.SUCCEEDED, "the runner's words")

    def publish_feedback(self, message: MoveHand.Feedback) -> None:
        self.feedback.append(message)
        if message.phase == Phase.APPROVAL and self.approves:
            self.approvals.approve(message.plan_id)

    approves = True

    def succeed(self) -> None:
        self.ended.append("succeeded")

    def abort(self) -> None:
        self.ended.append("aborted")

    def canceled(self) -> None:
        self.ended.append("cancelled")

    def see(self, stamp: float) -> None:
        self.clouds.put(raw_cloud(np.ones((3, 3), np.float32), int(stamp * S)))
        self.camera.put("panda_link0", "lens", Pose(np.eye(3), np.array([1.0, 2.0, 3.0])))
        self.camera.see("lens")

    def ask(self) -> ActionResult:
        return hand_result_from_msg(self.session.move_hand(self, logging.getLogger("session")))  # type: ignore[arg-type]


def test_a_blind_motion_needs_neither_cloud_nor_camera() -> None:
    bench = Bench()
    assert bench.ask().outcome is Outcome.SUCCEEDED and bench.ended == ["succeeded"]
    assert bench.clouds_got == [None] and bench.camera_at == []
    [goal] = bench.given
    assert goal.target.is_close(GOAL.target) and (goal.carried, goal.owner) == (0.16, "me")
    assert [(m.phase_name, round(m.progress, 2)) for m in bench.feedback] == [("CARRY", 0.6)]
    assert bench.feedback[0].plan_id


def test_a_blind_motion_avoids_a_camera_whose_place_is_known() -> None:
    bench = Bench()
    bench.see(9.0)
    assert bench.ask().outcome is Outcome.SUCCEEDED
    assert bench.clouds_got == [None] and np.array_equal(bench.camera_at, [[1.0, 2.0, 3.0]])


def test_any_other_motion_waits_for_a_cloud_from_after_the_last_one() -> None:
    bench = Bench()
    bench.request.blind = False
    refused = bench.ask()
    assert (refused.outcome, refused.refusal, bench.ended) == (Outcome.REJECTED, Refusal.NO_CLOUD, ["aborted"])
    assert bench.clouds_got == []
    bench.see(9.9)
    assert bench.ask().outcome is Outcome.REJECTED, "from before the last goal's end"
    bench.see(10.0)
    assert bench.ask().outcome is Outcome.SUCCEEDED and bench.clouds_got[0].shape == (3, 3)
    bench.see(14.9)
    assert bench.ask().refusal is Refusal.OLD_CLOUD


def test_a_motion_that_no_guard_watches_is_refused() -> None:
    bench = Bench()
    bench.guard.longest = 3.0
    assert (bench.ask().refusal, bench.given) == (Refusal.NO_GUARD, [])
    bench.guard.on_report()
    assert bench.ask().outcome is Outcome.SUCCEEDED


def test_a_motion_that_nobody_owns_is_refused() -> None:
    bench = Bench()
    bench.request.owner = ""
    assert (bench.ask().refusal, bench.given) == (Refusal.NO_OWNER, [])
    bench.request.plan_only = True
    assert bench.ask().outcome is Outcome.SUCCEEDED


def test_a_goal_that_makes_no_sense_is_refused() -> None:
    bench = Bench()
    bench.request.target.position.z = float("nan")
    refused = bench.ask()
    assert (refused.refusal, bench.given) == (Refusal.MALFORMED, []) and "the target cannot be used" in refused.message


@pytest.mark.parametrize("plan_only", [False, True])
def test_a_plan_waits_for_its_approval_unless_nothing_is_to_move(plan_only: bool) -> None:
    bench = Bench(auto_approve=False)
    bench.request.plan_only = plan_only
    assert bench.ask().outcome is Outcome.SUCCEEDED and bench.waited is not plan_only
    assert any(message.phase_name == "APPROVAL" for message in bench.feedback) is not plan_only


def test_a_plan_that_nobody_approves_is_not_carried_out() -> None:
    bench = Bench(auto_approve=False)
    bench.approves = False
    assert (bench.ask().refusal, bench.ended) == (Refusal.NOT_APPROVED, ["aborted"])


def test_a_stop_and_a_cancel_reach_the_runner() -> None:
    bench = Bench()
    bench.is_cancel_requested = True
    assert bench.ask().outcome is Outcome.CANCELLED and bench.ended == ["cancelled"]
    bench = Bench()
    bench.gate.latch("stopped")
    assert bench.ask().outcome is Outcome.CANCELLED and bench.ended == ["aborted"]
