"""One PickPlace goal: its data are checked, the runner runs, feedback and result go back."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.action.server import ServerGoalHandle

from cliport_interfaces.action import PickPlace
from cliport_perception.primitive import Outcome
from panda_executor import conversions
from panda_executor.cloud_cache import CloudCache
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.node_parameters import NodeParameters
from panda_executor.request import Phase, PickPlaceResult
from panda_executor.request_check import check_request
from panda_executor.runner import PickPlaceRunner


class GoalSession:
    """Runs goals for the node, one at a time."""

    def __init__(
        self,
        runner: PickPlaceRunner,
        clouds: CloudCache,
        parameters: NodeParameters,
        gate: Gate,
        now_ns: Callable[[], int],
    ) -> None:
        self._runner, self._clouds, self._parameters = runner, clouds, parameters
        self._gate, self._now_ns = gate, now_ns
        self._still_since_ns = 0

    def run(self, handle: ServerGoalHandle, logger: Any) -> PickPlace.Result:
        """From an accepted goal to its result message; the handle is brought to its final state."""
        began = time.monotonic()

        def should_stop() -> bool:
            return self._gate.stopped or bool(handle.is_cancel_requested)

        try:
            result = self._result(handle, should_stop)
        except RequestError as error:
            result = PickPlaceResult(Outcome.REJECTED, str(error), None, 0.0)
        except Exception as error:  # the goal must end whatever happens, with a line that names the fault
            logger.error(f"unexpected {type(error).__name__}: {error}")
            result = PickPlaceResult(
                Outcome.EXECUTION_FAILED, f"internal error: {type(error).__name__}: {error}", None, 0.0
            )
        took = time.monotonic() - began
        logger.info(f"{result.outcome.name} after {took:.1f} s: {result.message}")
        if result.outcome in (Outcome.SUCCEEDED, Outcome.PLANNED):
            handle.succeed()
        elif result.outcome is Outcome.CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return conversions.result_to_msg(result)

    def _result(self, handle: ServerGoalHandle, should_stop: Callable[[], bool]) -> PickPlaceResult:
        goal = handle.request
        frame = self._parameters.robot.base_frame

        def on_phase(phase: Phase, progress: float) -> None:
            handle.publish_feedback(conversions.feedback_to_msg(phase, progress))

        on_phase(Phase.VALIDATING, 0.0)
        request = conversions.request_from_msg(goal, frame)
        check_request(request, self._parameters.workspace)  # what no cloud can mend is said without waiting
        cloud = conversions.cloud_from_raw(self._fresh_cloud(goal, should_stop), frame)
        try:
            return self._runner.run(request, cloud, self._parameters.workspace, on_phase, should_stop)
        finally:
            self._still_since_ns = self._now_ns()

    def _fresh_cloud(self, goal: PickPlace.Goal, should_stop: Callable[[], bool]) -> bytes:
        """The newest cloud; when it will not do, the next ones are waited for a moment.

        Raises:
            RequestError: why none would do.
        """
        deadline = time.monotonic() + self._parameters.cloud_wait
        while True:
            try:
                return self._clouds.get(self._now_ns(), conversions.goal_stamp(goal), self._still_since_ns)
            except RequestError:
                if time.monotonic() > deadline or should_stop():
                    raise
            time.sleep(0.02)
