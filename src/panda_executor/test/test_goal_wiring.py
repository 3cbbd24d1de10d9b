"""What a goal's session gives the runner, waits for and says, over a runner that is played."""

from __future__ import annotations

import logging
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cliport_interfaces.action")

from ros_clouds import raw_cloud

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.messages import goal_to_msg, result_from_msg
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import goal_session, owned_runs
from panda_executor.approvals import Approvals
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.goal_session import GoalSession
from panda_executor.guard_watch import GuardWatch
from panda_executor.owned_runs import Watchers
from panda_executor.owner_watch import OwnerWatch
from panda_executor.phase import Phase
from panda_model import load_preset

S = 1_000_000_000
GOAL = ActionGoal(PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)), stamp_ns=9 * S, owner="me")


class Bench:
    """A session, its goal's handle and its runner at once; every sleep takes a quarter of a second."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, auto_approve: bool = True) -> None:
        self.steady, self.now = 64.0, 10.0
        self.request = goal_to_msg(GOAL, "panda_link0")
        self.is_cancel_requested = False
        self.ended, self.words, self.feedback = list[str](), list[str](), list[Any]()
        self.sleeps = 0
        self.on_sleep: Callable[[], None] = lambda: None
        self.act: Callable[..., ActionResult] = lambda: ActionResult(Outcome.SUCCEEDED, "done")
        self.given = SimpleNamespace()
        self.gate, self.clouds, self.camera = Gate(), CloudCache(), CameraPlace("panda_link0")
        self.owners, self.guard = OwnerWatch(lambda: self.steady, 0.1), GuardWatch(lambda: self.steady, 3.0)
        self.guard.on_report()
        self.shown: list[Any] = []
        self.approvals = Approvals(9.0, lambda: self.steady, lambda plan_id, motions: self.shown.append(motions))
        parameters: Any = SimpleNamespace(
            robot=load_preset(), workspace=WorkspaceSpec(), cloud_wait=1.0, auto_approve=auto_approve,
            require_owner=True, owner_silence=0.1, approval_time=9.0,
        )  # fmt: skip
        clock = SimpleNamespace(monotonic=lambda: self.steady, sleep=self._sleep)
        for module in (goal_session, owned_runs):
            monkeypatch.setattr(module, "time", clock)
        self.planner = SimpleNamespace(place_cameras=lambda position: self.words.append(f"camera at {position}"))
        self.session = GoalSession(
            self, self.clouds, self.camera, parameters, self.gate, lambda: int(self.now * S),  # type: ignore[arg-type]
            Watchers(self.owners, self.guard), self.approvals,
        )  # fmt: skip

    def _sleep(self, seconds: float) -> None:
        assert seconds == 0.02
        self.sleeps += 1
        self.steady += 0.25
        self.owners.on_beat("me")
        self.on_sleep()

    def run(self, *given: Any, **named: Any) -> Any:
        """The runner's, with seven values."""
        names = ("goal", "cloud", "workspace", "on_phase", "should_stop", "on_plan", "look")
        self.given = SimpleNamespace(**dict(zip(names, given, strict=True)))
        return self.act()

    def publish_feedback(self, message: Any) -> None:
        self.feedback.append((message.phase, message.progress, message.plan_id))

    def succeed(self) -> None:
        self.ended.append("succeeded")

    def abort(self) -> None:
        self.ended.append("aborted")

    def canceled(self) -> None:
        self.ended.append("cancelled")

    def see(self, stamp: float, frame: str = "panda_link0") -> None:
        self.clouds.put(raw_cloud(np.ones((3, 3), np.float32), int(stamp * S), frame))

    def calibrate(self) -> None:
        self.camera.put("panda_link0", "lens", Pose(np.eye(3), np.array([1.0, 2.0, 3.0])))
        self.camera.see("lens")

    def ask(self) -> ActionResult:
        logger = logging.getLogger("session")
        said = SimpleNamespace(
            info=self.words.append, warning=self.words.append, error=self.words.append, name=logger.name
        )
        return result_from_msg(self.session.run(self, said), ended_well=True)  # type: ignore[arg-type]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_the_runner_is_given_the_goal_as_it_came(bench: Bench) -> None:
    def act() -> ActionResult:
        bench.steady += 2.25
        return ActionResult(Outcome.SUCCEEDED, "done")

    bench.act = act
    assert bench.ask().outcome is Outcome.SUCCEEDED
    assert (bench.given.goal.stamp_ns, bench.given.goal.owner) == (9 * S, "me")
    assert bench.given.goal.action.pick.x == pytest.approx(0.45) and bench.given.workspace == WorkspaceSpec()
    assert bench.words == ["SUCCEEDED after 2.2 s: done"]
    assert bench.ended == ["succeeded"]


def test_a_goals_memory_is_given_back_once_it_has_ended(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[list[str]] = []
    monkeypatch.setattr(owned_runs, "trim_heap", lambda: ended.append(list(bench.ended)))
    bench.ask()
    assert ended == [["succeeded"]]


@pytest.mark.parametrize("reports", [3, 6])
def test_a_guard_that_has_just_begun_is_waited_for(bench: Bench, reports: int) -> None:
    """For a second, in which one that runs reports."""
    bench.steady += 60.0
    bench.on_sleep = lambda: bench.guard.on_report() if bench.sleeps == reports else None
    ended = bench.ask()
    assert ended.outcome is (Outcome.SUCCEEDED if reports == 3 else Outcome.REJECTED)
    assert bench.sleeps == min(reports, 5)


@pytest.mark.parametrize(("seconds", "ends"), [(2.9, False), (3.1, True)])
def test_a_guard_that_falls_silent_ends_the_motion_and_is_blamed(bench: Bench, seconds: float, ends: bool) -> None:
    def act() -> ActionResult:
        bench.steady += seconds
        bench.owners.on_beat("me")
        stopped = bench.given.should_stop()
        bench.guard.on_report()  # too late
        return ActionResult(Outcome.CANCELLED, "held") if stopped else ActionResult(Outcome.SUCCEEDED, "done")

    bench.act = act
    ended = bench.ask()
    assert ended.outcome is (Outcome.CANCELLED if ends else Outcome.SUCCEEDED)
    assert ended.message == ("no guard was heard for 3 s: held" if ends else "done")
    assert (ended.refusal, ended.refusal_limit) == ((Refusal.NO_GUARD, 3.0) if ends else (Refusal.NONE, None))


def test_a_guard_that_is_lost_while_a_plan_waits_for_approval_ends_the_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, auto_approve=False)

    def act() -> ActionResult:
        bench.given.on_plan([])
        return ActionResult(Outcome.SUCCEEDED, "it was approved")

    def wait(plan_id: str, should_stop: Callable[[], bool]) -> None:
        bench.steady += 3.1
        bench.owners.on_beat("me")
        if should_stop():
            raise RequestError("stopped", Refusal.NOT_APPROVED)

    bench.act = act
    monkeypatch.setattr(bench.approvals, "wait", wait)
    ended = bench.ask()
    assert (ended.outcome, ended.refusal) == (Outcome.REJECTED, Refusal.NO_GUARD)
    assert ended.message == "no guard was heard for 3 s: stopped"


def test_what_is_only_planned_needs_no_guard(bench: Bench) -> None:
    bench.request.plan_only = True
    bench.steady += 60.0
    bench.act = lambda: ActionResult(Outcome.PLANNED, "planned")
    assert bench.ask().outcome is Outcome.PLANNED and not bench.given.should_stop()


def test_a_goal_in_another_frame_is_refused(bench: Bench) -> None:
    bench.request = goal_to_msg(GOAL, "map")
    refused = bench.ask()
    assert (refused.outcome, refused.refusal) == (Outcome.REJECTED, Refusal.MALFORMED)
    assert "must be in frame 'panda_link0'" in refused.message and bench.ended == ["aborted"]


def test_a_refusals_numbers_reach_the_client(bench: Bench) -> None:
    def act() -> ActionResult:
        raise RequestError("too old", Refusal.OLD_CLOUD, 3.0, 2.0)

    bench.act = act
    refused = bench.ask()
    assert (refused.refusal, refused.refusal_value, refused.refusal_limit) == (Refusal.OLD_CLOUD, 3.0, 2.0)
    assert (refused.outcome, refused.message) == (Outcome.REJECTED, "too old")


def fetch(bench: Bench) -> Callable[[], ActionResult]:
    def act() -> ActionResult:
        cloud = bench.given.cloud()
        return ActionResult(Outcome.SUCCEEDED, f"{cloud.shape[0]} points")

    return act


def test_a_cloud_and_the_cameras_place_are_waited_for(bench: Bench) -> None:
    bench.act = fetch(bench)

    def on_sleep() -> None:
        if bench.sleeps == 2:
            bench.see(10.0)
        if bench.sleeps == 5:
            bench.calibrate()

    bench.on_sleep = on_sleep
    assert bench.ask().message == "3 points"
    assert bench.sleeps == 5, "each has its own time"
    assert bench.words[0] == "camera at [1. 2. 3.]"


def test_a_cloud_that_does_not_come_is_waited_for_no_longer_than_was_said(bench: Bench) -> None:
    bench.act = fetch(bench)
    refused = bench.ask()
    assert (refused.outcome, refused.refusal) == (Outcome.REJECTED, Refusal.NO_CLOUD)
    assert bench.sleeps == 5, "a second, and the look that found it over"


def test_a_stop_ends_the_wait_for_a_cloud(bench: Bench) -> None:
    bench.act = fetch(bench)
    bench.on_sleep = lambda: setattr(bench, "is_cancel_requested", bench.sleeps >= 2)
    assert bench.ask().outcome is Outcome.REJECTED
    assert bench.sleeps == 2


def test_a_cloud_from_before_the_goals_images_will_not_do(bench: Bench) -> None:
    bench.act = fetch(bench)
    bench.calibrate()
    bench.see(8.9)
    bench.on_sleep = lambda: bench.see(9.0) if bench.sleeps == 3 else None
    assert bench.ask().outcome is Outcome.SUCCEEDED
    assert bench.sleeps == 3


def test_a_cloud_in_another_frame_is_refused_at_once(bench: Bench) -> None:
    bench.act = fetch(bench)
    bench.calibrate()
    bench.see(10.0, "map")
    refused = bench.ask()
    assert "the point cloud is in frame 'map', expected 'panda_link0'" in refused.message
    assert bench.sleeps == 0


def looks(bench: Bench) -> Callable[[], ActionResult]:
    """Depart at 10 s, after the newest cloud, and look."""

    def act() -> ActionResult:
        bench.given.on_phase(Phase.CARRY, 0.5)
        return ActionResult(Outcome.SUCCEEDED, f"{bench.given.look().shape[0]} points")

    bench.see(9.9)
    return act


def test_a_last_look_waits_for_a_cloud_from_after_the_departure(bench: Bench) -> None:
    bench.act = looks(bench)
    bench.on_sleep = lambda: bench.see(10.0) if bench.sleeps == 3 else None
    assert bench.ask().message == "3 points"
    assert bench.sleeps == 3


@pytest.mark.parametrize("stop", [False, True])
def test_a_last_look_waits_no_longer_than_was_said_or_until_a_stop(bench: Bench, stop: bool) -> None:
    bench.act = looks(bench)
    bench.on_sleep = lambda: setattr(bench, "is_cancel_requested", stop and bench.sleeps == 2)
    unseen = bench.ask()
    assert (unseen.refusal, unseen.refusal_value) == (Refusal.OLD_CLOUD, pytest.approx(0.1))
    assert bench.sleeps == (2 if stop else 5), "a second, and the look that found it over"


def test_a_last_look_at_a_cloud_in_another_frame_is_none(bench: Bench) -> None:
    bench.act = looks(bench)
    bench.see(10.0, "map")
    assert "the point cloud is in frame 'map', expected 'panda_link0'" in bench.ask().message


@pytest.mark.parametrize("by", ["stop", "cancel", "silence"])
def test_whoever_may_stop_a_motion_does(bench: Bench, by: str) -> None:
    def act() -> ActionResult:
        assert bench.given.should_stop() is False
        if by == "stop":
            bench.gate.latch("stopped on request")
        if by == "cancel":
            bench.is_cancel_requested = True
        for _ in range(3 if by == "silence" else 1):
            bench.steady += 0.05
            stopped = bench.given.should_stop()
        assert stopped is True
        return ActionResult(Outcome.CANCELLED, "cancelled; the arm holds")

    bench.act = act
    ended = bench.ask()
    assert ended.outcome is Outcome.CANCELLED
    assert bench.ended == ["cancelled" if by == "cancel" else "aborted"]
    if by == "silence":
        words = "the goal's owner gave no sign of life for 0.1 s: cancelled; the arm holds"
        assert (ended.message, ended.refusal, ended.refusal_limit) == (words, Refusal.OWNER_SILENT, 0.1)
    else:
        assert (ended.message, ended.refusal) == ("cancelled; the arm holds", Refusal.NONE)


def test_a_cancel_that_came_too_late_is_none(bench: Bench) -> None:
    bench.is_cancel_requested = True
    bench.act = lambda: ActionResult(Outcome.GRASP_MISSED, "missed")
    bench.ask()
    assert bench.ended == ["aborted"]


def test_feedback_names_the_plan_once_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch, auto_approve=False)
    waited: list[bool] = []

    def act() -> ActionResult:
        bench.given.on_phase(Phase.GRASP_PLANNING, 0.25)
        publish = bench.publish_feedback

        def hear(message: Any) -> None:
            publish(message)
            bench.approvals.approve(message.plan_id)

        bench.publish_feedback = hear  # type: ignore[method-assign]
        waited.append(bench.given.on_plan(["a motion"]))
        bench.given.on_phase(Phase.CARRY, 0.625)
        return ActionResult(Outcome.SUCCEEDED, "done")

    bench.act = act
    bench.ask()
    plan_id = bench.feedback[1][2]
    assert plan_id and waited == [True] and bench.shown == [["a motion"]]
    assert bench.feedback == [
        (int(Phase.GRASP_PLANNING), 0.25, ""),
        (int(Phase.APPROVAL), pytest.approx(0.2), plan_id),
        (int(Phase.CARRY), 0.625, plan_id),
    ]
