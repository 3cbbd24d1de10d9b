"""The handling of PickPlace goals: their data are checked, the runner runs, feedback and result go back."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from rclpy.action.server import ServerGoalHandle

from cliport_core import topics
from cliport_core.action import ActionGoal
from cliport_core.errors import GoalError
from cliport_core.messages import goal_from_msg, result_to_msg
from cliport_core.outcome import ActionResult, Outcome, Refusal
from cliport_core.raw_header import header_of_raw
from cliport_interfaces.action import PickPlace
from panda_executor import conversions
from panda_executor.approvals import Approvals
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.motions import Motion
from panda_executor.node_parameters import NodeParameters
from panda_executor.owner_watch import OwnerWatch
from panda_executor.phase import Phase
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
        owners: OwnerWatch | None = None,
        approvals: Approvals | None = None,
    ) -> None:
        self._owners = owners or OwnerWatch(time.monotonic, parameters.owner_silence)
        self._approvals = approvals or Approvals(parameters.approval_time)
        self._runner, self._clouds, self._camera, self._parameters = runner, clouds, camera, parameters
        self._gate, self._now_ns = gate, now_ns
        self._still_since_ns = 0

    def run(self, handle: ServerGoalHandle, logger: Any) -> PickPlace.Result:
        """Run an accepted goal; return its result message once the handle is in its final state."""
        began = time.monotonic()
        owner = str(handle.request.owner)
        self._owners.begin(owner)

        def should_stop() -> bool:
            return self._gate.stopped or bool(handle.is_cancel_requested) or self._owners.is_silent(owner)

        try:
            result = self._result(handle, should_stop, logger)
        except RequestError as error:
            result = ActionResult(
                Outcome.REJECTED,
                str(error),
                refusal=error.refusal,
                refusal_value=error.value,
                refusal_limit=error.limit,
            )
        except Exception as error:  # the goal must end whatever happens, with a line that names the fault
            logger.error(f"unexpected {type(error).__name__}: {error}")
            result = ActionResult(Outcome.EXECUTION_FAILED, f"internal error: {type(error).__name__}: {error}")
        if result.outcome is Outcome.CANCELLED and self._owners.is_silent(owner):
            words = f"the goal's owner gave no sign of life for {self._owners.longest:g} s: {result.message}"
            result = replace(result, message=words, refusal=Refusal.OWNER_SILENT, refusal_limit=self._owners.longest)
        took = time.monotonic() - began
        logger.info(f"{result.outcome.name} after {took:.1f} s: {result.message}")
        if result.outcome.is_success:
            handle.succeed()
        elif result.outcome is Outcome.CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return result_to_msg(result)

    def _result(self, handle: ServerGoalHandle, should_stop: Callable[[], bool], logger: Any) -> ActionResult:
        message: PickPlace.Goal = handle.request
        frame = self._parameters.robot.base_frame

        plan_id = ""

        departures: dict[Phase, int] = {}  # when each phase began

        def on_phase(phase: Phase, progress: float) -> None:
            departures.setdefault(phase, self._now_ns())
            handle.publish_feedback(conversions.feedback_to_msg(phase, progress, plan_id))

        def on_plan(motions: Sequence[Motion]) -> bool:
            nonlocal plan_id
            plan_id = self._approvals.present(motions)
            waits = not (self._parameters.auto_approve or message.plan_only)
            if waits:
                self._approvals.offer(plan_id)
                on_phase(Phase.APPROVAL, Phase.APPROVAL.progress())
                self._approvals.wait(plan_id, should_stop)
            return waits

        try:
            goal = goal_from_msg(message, frame)
        except GoalError as error:
            raise RequestError(str(error)) from None
        self._check_owner(goal)

        def look() -> npt.NDArray[np.float32] | None:
            newest = self._clouds.newest(self._now_ns())
            if newest is None or header_of_raw(newest)[0] < max(departures.values(), default=0):
                return None
            try:
                return conversions.cloud_from_raw(newest, frame)
            except RequestError as error:
                logger.warning(f"the object is not looked at again: {error}")
                return None

        def cloud() -> npt.NDArray[np.float32]:
            raw = self._fresh_cloud(goal.stamp_ns, should_stop)
            # A cloud has come, so perception knows where the camera is: what says it is on its way to here, too.
            self._runner.planner.place_camera(self._patiently(self._camera.position, should_stop))
            return conversions.cloud_from_raw(raw, frame)

        try:
            return self._runner.run(goal, cloud, self._parameters.workspace, on_phase, should_stop, on_plan, look)
        finally:
            self._still_since_ns = self._now_ns()

    def _check_owner(self, goal: ActionGoal) -> None:
        if self._parameters.require_owner and not goal.owner and not goal.plan_only:
            raise RequestError(
                "the goal names no owner: its motion would go on if whoever asked for it died; name one and give its "
                f"signs of life on {topics.OWNER_HEARTBEAT}, or start the executor with require_owner:=false",
                Refusal.NO_OWNER,
            )

    def _fresh_cloud(self, stamp_ns: int, should_stop: Callable[[], bool]) -> bytes:
        """Return the newest cloud; when it will not do, wait a moment for the next ones.

        stamp_ns: of the observation that the goal comes from, 0 where it does not say.

        Raises:
            RequestError: why none would do.
        """
        return self._patiently(lambda: self._clouds.get(self._now_ns(), stamp_ns, self._still_since_ns), should_stop)

    def _patiently(self, get: Callable[[], Got], should_stop: Callable[[], bool]) -> Got:
        """Return what `get` returns once it raises no RequestError any more; raise that after `cloud_wait`."""
        deadline = time.monotonic() + self._parameters.cloud_wait
        while True:
            try:
                return get()
            except RequestError:
                if time.monotonic() > deadline or should_stop():
                    raise
            time.sleep(0.02)
