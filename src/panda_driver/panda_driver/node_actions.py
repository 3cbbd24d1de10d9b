"""The action servers in front of the arm's and of the hand's loop."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any

from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.action import CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node

from cliport_core.ros_action_server import ThreadedActionServer
from panda_driver.arm_loop import ArmLoop
from panda_driver.errors import HandGoalError
from panda_driver.hand import Hand
from sim_bridge import conversions
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import GripperGoal, GripperResult
from sim_bridge.control.joint_trajectory_controller import GoalRejectedError, TrajectoryExecution
from sim_bridge.control.trajectory_goal import ErrorCode, TrajectoryGoal

_FEEDBACK_PERIOD = 0.05  # wall clock [s]
_CANCEL_ARRIVES = 1.0  # for rclpy to know of a cancel that its callback was told of, wall clock [s]


class ArmAction:
    """FollowJointTrajectory in front of the arm's loop."""

    def __init__(self, node: Node, loop: ArmLoop, name: str, joint_names: tuple[str, ...]) -> None:
        self._node, self._loop, self._name, self._joint_names = node, loop, name, joint_names
        self._executions: dict[bytes, TrajectoryExecution] = {}
        self._server = ThreadedActionServer(
            node,
            FollowJointTrajectory,
            name,
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    def _decode(self, request: FollowJointTrajectory.Goal) -> TrajectoryGoal:
        """Return the goal in the loop's time. Raises GoalRejectedError."""
        goal = conversions.trajectory_goal_from_msg(request)
        if goal.start_time is None:
            return goal
        delay = goal.start_time - self._node.get_clock().now().nanoseconds * 1e-9
        return replace(goal, start_time=self._loop.time + delay)

    def _accept(self, request: FollowJointTrajectory.Goal) -> GoalResponse:
        try:
            self._loop.check(self._decode(request))
        except GoalRejectedError as error:
            self._node.get_logger().warning(f"{self._name}: goal rejected: {error}")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        execution = self._executions.get(bytes(handle.goal_id.uuid))
        if execution is not None:
            self._loop.cancel(execution)
        return CancelResponse.ACCEPT

    def _execute(self, handle: ServerGoalHandle) -> FollowJointTrajectory.Result:
        key = bytes(handle.goal_id.uuid)
        try:
            execution = self._loop.start(self._decode(handle.request))
        except GoalRejectedError as error:  # something else began since it was accepted
            _end(self._node, self._name, handle, GoalStatus.ABORTED, str(error))
            return FollowJointTrajectory.Result(error_code=int(ErrorCode.INVALID_GOAL), error_string=str(error))
        self._executions[key] = execution
        if handle.is_cancel_requested:  # it came while the goal was being started
            self._loop.cancel(execution)
        begin = time.monotonic()
        while not execution.done:
            if time.monotonic() - begin > _FEEDBACK_PERIOD:
                begin = time.monotonic()
                self._publish(handle)
            time.sleep(0.005)
        self._publish(handle)  # where the path ended, and the arm then
        self._executions.pop(key, None)
        _end(self._node, self._name, handle, execution.status, execution.error_string)
        return conversions.trajectory_result_to_msg(execution)

    def _publish(self, handle: ServerGoalHandle) -> None:
        feedback = self._loop.feedback()
        if feedback is None:
            return
        stamped = replace(feedback, time=self._node.get_clock().now().nanoseconds * 1e-9)
        with suppress(InvalidHandle):  # the node ends
            handle.publish_feedback(conversions.trajectory_feedback_to_msg(stamped, self._joint_names))


class HandAction:
    """GripperCommand in front of the hand."""

    kind: Any = GripperCommand

    def __init__(self, node: Node, hand: Hand, name: str) -> None:
        self._node, self._hand, self._name = node, hand, name
        self._server = ThreadedActionServer(
            node,
            self.kind,
            name,
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    def _goal(self, request: Any) -> GripperGoal:
        """Return the goal of a request."""
        return conversions.gripper_goal_from_msg(request)

    def _result(self, status: GoalStatus, result: GripperResult, words: str) -> Any:
        """Return the result's message."""
        return conversions.gripper_result_to_msg(result)

    def _accept(self, request: Any) -> GoalResponse:
        try:
            self._hand.check(self._goal(request))
        except HandGoalError as error:
            self._node.get_logger().warning(f"{self._name}: goal rejected: {error}")
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _cancel(self, _: ServerGoalHandle) -> CancelResponse:
        self._hand.halt()
        return CancelResponse.ACCEPT

    def _execute(self, handle: ServerGoalHandle) -> Any:
        with _reporting(lambda: self._publish(handle)):
            status, result, words = self._hand.execute(self._goal(handle.request))
        _end(self._node, self._name, handle, status, words)
        return self._result(status, result, words)

    def _publish(self, handle: ServerGoalHandle) -> None:
        with suppress(InvalidHandle):
            handle.publish_feedback(conversions.gripper_feedback_to_msg(self._hand.report()))


class _reporting:
    """Calls a function now and then, in a thread of its own, while the body runs."""

    def __init__(self, report: Callable[[], None]) -> None:
        self._report, self._ended = report, threading.Event()
        self._thread = threading.Thread(target=self._run, name="feedback", daemon=True)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: Any) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(_FEEDBACK_PERIOD):
            self._report()


def _end(node: Node, name: str, handle: ServerGoalHandle, status: GoalStatus, words: str) -> None:
    """End a goal as its execution ended."""
    with suppress(RuntimeError, InvalidHandle):  # the node ends
        if status is GoalStatus.SUCCEEDED:
            handle.succeed()
            return
        deadline = time.monotonic() + _CANCEL_ARRIVES
        while status is GoalStatus.CANCELED and time.monotonic() < deadline:
            if handle.is_cancel_requested:  # the handle learns of it only after its callback returned
                handle.canceled()
                return
            time.sleep(0.005)
        node.get_logger().warning(f"{name}: goal aborted: {words}")
        handle.abort()
