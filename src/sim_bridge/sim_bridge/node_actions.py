"""An action server in front of a controller that a simulation loop runs."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Any

from rclpy.action import CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from cliport_core.ros_action_server import ThreadedActionServer
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.joint_trajectory_controller import TrajectoryExecution
from sim_bridge.errors import SimBridgeError
from sim_bridge.sim_loop import Execution, SimLoop

FEEDBACK_PERIOD_S = 0.08  # wall time


class ControllerAction(ABC):
    """One action server; subclasses say how its goals reach their controller.

    A goal that the controller refuses is rejected, with the reason in the log. The rest is the controller's
    doing: this class starts, cancels, reports and ends.
    """

    def __init__(self, node: Node, loop: SimLoop, action_type: Any, name: str) -> None:
        self._loop = loop
        self._name = name
        self._logger = node.get_logger()
        self._executions: dict[bytes, Execution] = {}
        self._decoded: dict[int, tuple[Any, Any]] = {}  # accepted requests, by identity, with what they say
        self._server = ThreadedActionServer(
            node,
            action_type,
            name,
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    @abstractmethod
    def _decode(self, request: Any) -> Any:
        """Return the goal as the controller takes it. Raises SimBridgeError for a request that holds none."""

    @abstractmethod
    def _check(self, goal: Any) -> None:
        """Raise SimBridgeError unless the controller would take the goal; on the loop's thread."""

    @abstractmethod
    def _start(self, goal: Any) -> Execution:
        """Hand the goal to the controller, or raise SimBridgeError; on the loop's thread."""

    @abstractmethod
    def _cancel_now(self, execution: Any) -> None:
        """Cancel the execution if it still runs; on the loop's thread."""

    @abstractmethod
    def _feedback(self) -> Any | None:
        """Return the feedback message for this moment; on the loop's thread."""

    @abstractmethod
    def _result(self, execution: Any | None, message: str = "") -> Any:
        """Return the result message of an execution that ended, or of a goal that was never started."""

    def _accept(self, request: Any) -> GoalResponse:
        try:
            goal = self._decode(request)
            self._loop.call(lambda: self._check(goal))
        except SimBridgeError as error:
            self._logger.warning(f"{self._name}: goal rejected: {error}")
            return GoalResponse.REJECT
        self._decoded[id(request)] = request, goal
        return GoalResponse.ACCEPT

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        execution = self._executions.get(bytes(handle.goal_id.uuid))
        if execution is not None:
            self._loop.call(lambda: self._cancel_now(execution))
        return CancelResponse.ACCEPT

    def _execute(self, handle: ServerGoalHandle) -> Any:
        try:
            request = handle.request
            _, goal = self._decoded.pop(id(request), (None, None))
            if goal is None:  # this rclpy hands on another object than it had accepted
                goal = self._decode(request)
            execution = self._loop.call(lambda: self._start(goal))
        except SimBridgeError as error:
            self._logger.warning(f"{self._name}: goal aborted: {error}")
            handle.abort()
            return self._result(None, str(error))
        key = bytes(handle.goal_id.uuid)
        self._executions[key] = execution
        try:
            self._follow(handle, execution)
        except (SimBridgeError, InvalidHandle) as error:  # the simulation ends in mid-motion, as by Ctrl-C
            self._logger.warning(f"{self._name}: goal aborted: {error}")
            with suppress(RuntimeError):  # rclpy's for a server that is gone already
                handle.abort()
        finally:
            self._executions.pop(key, None)
        return self._result(execution)

    def _follow(self, handle: ServerGoalHandle, execution: Execution) -> None:
        """Publish feedback until the execution has ended, then end the goal as it did."""
        if handle.is_cancel_requested:  # it came while the goal was being started
            self._loop.call(lambda: self._cancel_now(execution))
        while not self._loop.wait(execution, FEEDBACK_PERIOD_S):
            feedback = self._loop.call(self._feedback)
            if feedback is not None:
                handle.publish_feedback(feedback)
        while not self._is_told() and not handle.is_cancel_requested:
            time.sleep(FEEDBACK_PERIOD_S)
            self._loop.call(self._feedback)  # raises once the simulation has ended
        self._end(handle, execution)

    def _is_told(self) -> bool:
        """Return whether the end of an execution is told its client now."""
        return True

    def _end(self, handle: ServerGoalHandle, execution: Execution) -> None:
        if execution.status is GoalStatus.SUCCEEDED:
            handle.succeed()
            return
        deadline = time.monotonic() + 1.0
        while execution.status is GoalStatus.CANCELED and time.monotonic() < deadline:
            if handle.is_cancel_requested:  # the handle learns of it only after `_cancel` returned
                handle.canceled()
                return
            time.sleep(0.005)
        self._logger.warning(f"{self._name}: goal aborted: {_reason(execution)}")
        handle.abort()


def _reason(execution: Execution) -> str:
    return execution.error_string if isinstance(execution, TrajectoryExecution) else execution.message
