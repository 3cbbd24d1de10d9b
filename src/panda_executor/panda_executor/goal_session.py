"""The handling of goals: their data are checked, the runner runs, feedback and result go back."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from rclpy.action.server import ServerGoalHandle

from cliport_core.errors import GoalError
from cliport_core.messages import goal_from_msg, result_to_msg
from cliport_core.messages_hand import hand_goal_from_msg, hand_result_to_msg
from cliport_core.outcome import ActionResult
from cliport_interfaces.action import MoveHand, PickPlace
from panda_executor import conversions
from panda_executor.approvals import Approvals
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.node_parameters import NodeParameters
from panda_executor.owned_runs import GoalFeedback, OwnedRuns, Watchers
from panda_executor.phase import Phase
from panda_executor.ports import ShouldStop
from panda_executor.runner import PickPlaceRunner

Got = TypeVar("Got")


class GoalSession:
    """Runs goals for the node, one at a time."""

    def __init__(
        self,
        runner: PickPlaceRunner,
        clouds: CloudCache,
        camera: CameraPlace,
        parameters: NodeParameters,
        gate: Gate,
        now_ns: Callable[[], int],
        watchers: Watchers,
        approvals: Approvals,
    ) -> None:
        self._owned = OwnedRuns(gate, watchers, parameters.require_owner)
        self._approvals = approvals
        self._runner, self._clouds, self._camera, self._parameters = runner, clouds, camera, parameters
        self._now_ns = now_ns
        self._still_since_ns = 0

    def run(self, handle: ServerGoalHandle, logger: Any) -> PickPlace.Result:
        """Run an accepted goal; return its result message once the handle is in its final state."""
        return result_to_msg(self._owned.run(handle, logger, lambda stop: self._pick_place(handle, stop, logger)))

    def move_hand(self, handle: ServerGoalHandle, logger: Any) -> MoveHand.Result:
        """Run an accepted goal of the hand as `run` does."""
        return hand_result_to_msg(self._owned.run(handle, logger, lambda stop: self._move_hand(handle, stop)))

    def _pick_place(self, handle: ServerGoalHandle, should_stop: ShouldStop, logger: Any) -> ActionResult:
        message: PickPlace.Goal = handle.request
        frame = self._parameters.robot.base_frame
        departures: dict[Phase, int] = {}  # when each phase began
        feedback = self._feedback(
            handle,
            conversions.feedback_to_msg,
            bool(message.plan_only),
            should_stop,
            lambda phase: departures.setdefault(phase, self._now_ns()),
        )
        try:
            goal = goal_from_msg(message, frame)
        except GoalError as error:
            raise RequestError(str(error)) from None
        self._check_watched(goal.owner, goal.plan_only, should_stop)

        def look() -> npt.NDArray[np.float32]:
            departed = max(departures.values(), default=0)
            raw = self._patiently(lambda: self._clouds.since(self._now_ns(), departed), should_stop)
            return conversions.cloud_from_raw(raw, frame)

        try:
            return self._runner.run(
                goal,
                lambda: self._cloud(goal.stamp_ns, should_stop),
                self._parameters.workspace,
                feedback.on_phase,
                should_stop,
                feedback.on_plan,
                look,
            )
        finally:
            self._still_since_ns = self._now_ns()

    def _move_hand(self, handle: ServerGoalHandle, should_stop: ShouldStop) -> ActionResult:
        message: MoveHand.Goal = handle.request
        feedback = self._feedback(
            handle, conversions.hand_feedback_to_msg, bool(message.plan_only), should_stop, lambda phase: None
        )
        try:
            goal = hand_goal_from_msg(message, self._parameters.robot.base_frame)
        except GoalError as error:
            raise RequestError(str(error)) from None
        self._check_watched(goal.owner, goal.plan_only, should_stop)

        def cloud() -> npt.NDArray[np.float32] | None:
            if not goal.blind:
                return self._cloud(0, should_stop)
            with suppress(RequestError):  # the camera's place is what a calibration is to find
                self._runner.planner.place_cameras(*self._camera.positions())
            return None

        try:
            return self._runner.move_hand(
                goal, cloud, self._parameters.workspace, feedback.on_phase, should_stop, feedback.on_plan
            )
        finally:
            self._still_since_ns = self._now_ns()

    def _check_watched(self, owner: str, plan_only: bool, should_stop: ShouldStop) -> None:
        """Check that a goal that moves the arm has an owner and a guard. Raises RequestError."""
        self._owned.check(owner, plan_only)
        if not plan_only:
            self._patiently(self._owned.need_guard, should_stop)  # one that has just begun reports soon

    def _feedback(
        self,
        handle: ServerGoalHandle,
        to_msg: Callable[[Phase, float, str], Any],
        plan_only: bool,
        should_stop: ShouldStop,
        on_phase: Callable[[Phase], Any],
    ) -> GoalFeedback:
        def publish(phase: Phase, progress: float, plan_id: str) -> None:
            handle.publish_feedback(to_msg(phase, progress, plan_id))

        waits = not (self._parameters.auto_approve or plan_only)
        return GoalFeedback(publish, self._approvals, waits, should_stop, on_phase)

    def _cloud(self, stamp_ns: int, should_stop: ShouldStop) -> npt.NDArray[np.float32]:
        """Return a fresh cloud (N, 3) [m, base frame]; arguments and errors as in `_fresh_cloud`."""
        raw = self._fresh_cloud(stamp_ns, should_stop)
        # A cloud has come, so perception knows where the cameras are: what says it is on its way to here, too.
        self._runner.planner.place_cameras(*self._patiently(self._camera.positions, should_stop))
        return conversions.cloud_from_raw(raw, self._parameters.robot.base_frame)

    def _fresh_cloud(self, stamp_ns: int, should_stop: ShouldStop) -> bytes:
        """Return the newest cloud; when it will not do, wait a moment for the next ones.

        stamp_ns: of the observation that the goal comes from, 0 where it does not say.

        Raises:
            RequestError: why none would do.
        """
        return self._patiently(lambda: self._clouds.get(self._now_ns(), stamp_ns, self._still_since_ns), should_stop)

    def _patiently(self, get: Callable[[], Got], should_stop: ShouldStop) -> Got:
        """Return what `get` returns once it raises no RequestError any more; raise that after `cloud_wait`."""
        deadline = time.monotonic() + self._parameters.cloud_wait
        while True:
            try:
                return get()
            except RequestError:
                if time.monotonic() > deadline or should_stop():
                    raise
            time.sleep(0.02)
