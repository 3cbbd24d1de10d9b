"""The action servers of the arm and of the hand."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from control_msgs.action import FollowJointTrajectory, GripperCommand
from franka_msgs.action import Grasp, Homing, Move
from rclpy.action import GoalResponse
from rclpy.node import Node
from std_srvs.srv import Trigger

from panda_model import ArmModel
from sim_bridge import conversions
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import GripperExecution, GripperGoal, GripperResult, HandTask
from sim_bridge.control.joint_trajectory_controller import TrajectoryExecution
from sim_bridge.control.trajectory_goal import ErrorCode, TrajectoryGoal, validate_goal
from sim_bridge.control.trajectory_log import TrajectoryLog
from sim_bridge.node_actions import ControllerAction
from sim_bridge.node_faults import FaultInjection
from sim_bridge.sim_loop import SimLoop

UNANSWERED_S = 15.0  # a goal that is not to be accepted, at most


class ArmAction(ControllerAction):
    """FollowJointTrajectory in front of the arm's controller."""

    def __init__(self, node: Node, loop: SimLoop, name: str, faults: FaultInjection, log: TrajectoryLog) -> None:
        self._faults = faults
        self._log = log
        super().__init__(node, loop, FollowJointTrajectory, name)

    def _decode(self, request: FollowJointTrajectory.Goal) -> TrajectoryGoal:
        return conversions.trajectory_goal_from_msg(request)

    def _accept(self, request: FollowJointTrajectory.Goal) -> GoalResponse:
        deadline = time.monotonic() + UNANSWERED_S
        while self._faults.is_on("never_accept") and time.monotonic() < deadline:
            time.sleep(0.05)
        return super()._accept(request)

    def _is_told(self) -> bool:
        return not self._faults.is_on("never_end")

    def _check(self, goal: TrajectoryGoal) -> None:
        validate_goal(goal, self._loop.arm.config.joint_names, self._loop.world.time)

    def _start(self, goal: TrajectoryGoal) -> TrajectoryExecution:
        now = self._loop.world.time
        execution = self._loop.arm.start(self._faults.adapted(goal), now)
        self._log.append(goal, now)
        self._faults.started(execution, now)
        return execution

    def _cancel_now(self, execution: TrajectoryExecution) -> None:
        if self._faults.is_on("lose_cancel"):
            return
        if self._loop.arm.active is execution:
            self._loop.arm.cancel()

    def _feedback(self) -> FollowJointTrajectory.Feedback | None:
        feedback = self._loop.arm.feedback()
        if feedback is None:
            return None
        return conversions.trajectory_feedback_to_msg(feedback, self._loop.arm.config.joint_names)

    def _result(self, execution: TrajectoryExecution | None, message: str = "") -> FollowJointTrajectory.Result:
        if execution is None:
            return FollowJointTrajectory.Result(error_code=int(ErrorCode.INVALID_GOAL), error_string=message)
        return conversions.trajectory_result_to_msg(execution)


class GripperAction(ControllerAction):
    """GripperCommand in front of the hand's controller."""

    def __init__(self, node: Node, loop: SimLoop, name: str, faults: FaultInjection) -> None:
        self._faults = faults
        super().__init__(node, loop, GripperCommand, name)

    def _decode(self, request: GripperCommand.Goal) -> GripperGoal:
        return conversions.gripper_goal_from_msg(request)

    def _check(self, goal: GripperGoal) -> None:
        self._loop.gripper.check(goal)

    def _start(self, goal: GripperGoal) -> GripperExecution:
        self._faults.closing(goal)
        return self._loop.gripper.start(goal, self._loop.world.time)

    def _cancel_now(self, execution: GripperExecution) -> None:
        if self._loop.gripper.active is execution:
            self._loop.gripper.cancel()

    def _feedback(self) -> GripperCommand.Feedback:
        return conversions.gripper_feedback_to_msg(self._loop.gripper.feedback())

    def _result(self, execution: GripperExecution | None, message: str = "") -> GripperCommand.Result:
        result = execution.result if execution is not None else None
        return conversions.gripper_result_to_msg(result or GripperResult(0.0, 0.0, False, False))


class FrankaHandAction(GripperAction):
    """One of franka_msgs' actions in front of the hand's controller: Grasp, Move or Homing."""

    def __init__(
        self,
        node: Node,
        loop: SimLoop,
        action_type: Any,
        name: str,
        decode: Callable[[Any], GripperGoal],
        faults: FaultInjection,
    ) -> None:
        self._type, self._goal_of, self._faults = action_type, decode, faults
        ControllerAction.__init__(self, node, loop, action_type, name)

    def _decode(self, request: Any) -> GripperGoal:
        return self._goal_of(request)

    def _feedback(self) -> None:
        return None

    def _result(self, execution: GripperExecution | None, message: str = "") -> Any:
        done = execution is not None and execution.status is GoalStatus.SUCCEEDED
        error = execution.message if execution is not None else message
        return self._type.Result(success=done, error="" if done else error)


def serve_franka_hand(node: Node, loop: SimLoop, arm: ArmModel, faults: FaultInjection) -> list[FrankaHandAction]:
    """Make the servers that franka_gripper has below the preset's name, where it has one."""
    if not arm.franka_gripper:
        return []

    def stop(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        loop.call(loop.gripper.cancel)
        response.success = True
        return response

    node.create_service(Trigger, arm.gripper_stop, stop)
    home = GripperGoal(loop.gripper.config.max_width / 2.0, task=HandTask.HOMING)
    kinds: tuple[tuple[Any, str, Callable[[Any], GripperGoal]], ...] = (
        (Grasp, arm.grasp_action, conversions.grasp_goal_from_msg),
        (Move, arm.move_action, conversions.move_goal_from_msg),
        (Homing, arm.homing_action, lambda _: home),
    )
    return [FrankaHandAction(node, loop, kind, name, decode, faults) for kind, name, decode in kinds]
