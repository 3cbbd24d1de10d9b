"""Services of the executor for a person: stop, resume, approve, ready, open and recover."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.outcome import ActionResult
from cliport_interfaces.srv import ApprovePlan
from panda_executor.approvals import Approvals
from panda_executor.errors import RequestError
from panda_executor.gate import Gate
from panda_executor.ports import ShouldStop
from panda_executor.runner import PickPlaceRunner
from panda_executor.surroundings import Surroundings

Cloud = npt.NDArray[np.float32]
Answer = Callable[[Trigger.Request, Trigger.Response], Trigger.Response]


class PersonServices:
    """Offers the services; what moves runs through the gate, in a thread of its own, and its end is logged.

    Args:
        stop: cancels all goals of the controllers.
    """

    def __init__(
        self,
        node: Node,
        gate: Gate,
        runner: PickPlaceRunner,
        approvals: Approvals,
        stop: Callable[[], None],
        surroundings: Surroundings,
        group: CallbackGroup,
    ) -> None:
        self._node, self._gate, self._approvals, self._stop = node, gate, approvals, stop
        self._surroundings = surroundings
        node.create_service(Trigger, topics.EXECUTOR_STOP, self._on_stop, callback_group=group)
        node.create_service(Trigger, topics.EXECUTOR_RESUME, self._on_resume, callback_group=group)
        node.create_service(ApprovePlan, topics.EXECUTOR_APPROVE, self._on_approve, callback_group=group)
        motions: dict[str, Callable[[ShouldStop, Cloud | None], ActionResult]] = {
            topics.EXECUTOR_READY: runner.go_ready,
            topics.EXECUTOR_RECOVER: runner.recover,
        }
        for name, motion in motions.items():
            node.create_service(Trigger, name, self._mover(name, motion), callback_group=group)
        node.create_service(
            Trigger, topics.EXECUTOR_OPEN, self._starter(topics.EXECUTOR_OPEN, runner.open), callback_group=group
        )

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._gate.latch("stopped on request")
        self._stop()
        response.success, response.message = True, f"stopped; goals are rejected until {topics.EXECUTOR_RESUME}"
        return response

    def _on_resume(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._gate.release()
        response.success, response.message = True, "goals are accepted"
        return response

    def _on_approve(self, request: ApprovePlan.Request, response: ApprovePlan.Response) -> ApprovePlan.Response:
        response.success, response.message = self._approvals.approve(str(request.plan_id))
        return response

    def _mover(self, name: str, motion: Callable[[ShouldStop, Cloud | None], ActionResult]) -> Answer:
        """Return a callback that begins a motion of the arm, and says what that cannot avoid."""
        start = self._starter(name, lambda should_stop: motion(should_stop, self._surroundings.cloud()))

        def answer(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                missing = self._surroundings.missing()
            except RequestError as error:
                response.success, response.message = False, str(error)
                return response
            response = start(request, response)
            if response.success and missing:
                self._node.get_logger().warning(f"{name}: {missing}")
                response.message = f"{response.message}; {missing}"
            return response

        return answer

    def _starter(self, name: str, work: Callable[[ShouldStop], ActionResult]) -> Answer:
        """Return a callback that begins `work` and answers at once: its end is in the log."""

        def run() -> None:
            logger = self._node.get_logger()
            try:
                result = work(lambda: self._gate.stopped)
                logger.info(f"{name}: {result.outcome.name}: {result.message}")
            except Exception as error:  # a thread of its own: nobody else would hear of it
                logger.error(f"{name}: unexpected {type(error).__name__}: {error}")
            finally:
                self._gate.leave()

        def start(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            refusal = self._gate.enter()
            response.success, response.message = refusal is None, refusal or "begun; the log says how it ends"
            if refusal is None:
                threading.Thread(target=run, name="person", daemon=True).start()
            return response

        return start
