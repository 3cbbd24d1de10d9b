"""The actions of franka_msgs in front of the hand, and the service that stops it."""

from __future__ import annotations

from typing import Any

from franka_msgs.action import Grasp, Homing, Move
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from std_srvs.srv import Trigger

from panda_driver.hand import Hand
from panda_driver.node_actions import HandAction
from panda_model import ArmModel
from sim_bridge import conversions
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import GripperGoal, GripperResult, HandTask


class GraspAction(HandAction):
    """franka_msgs/Grasp: done where the hand says so, by the goal's own epsilon."""

    kind: Any = Grasp

    def _goal(self, request: Any) -> GripperGoal:
        return conversions.grasp_goal_from_msg(request)

    def _result(self, status: GoalStatus, result: GripperResult, words: str) -> Any:
        return self.kind.Result(success=status is GoalStatus.SUCCEEDED, error=words)

    def _publish(self, handle: ServerGoalHandle) -> None:
        """Say nothing: its feedback is empty."""


class MoveAction(GraspAction):
    """franka_msgs/Move."""

    kind: Any = Move

    def _goal(self, request: Any) -> GripperGoal:
        return conversions.move_goal_from_msg(request)


class HomingAction(GraspAction):
    """franka_msgs/Homing; connects a hand that was lost."""

    kind: Any = Homing

    def _goal(self, request: Any) -> GripperGoal:
        return GripperGoal(0.0, task=HandTask.HOMING)


def serve_franka_hand(node: Node, hand: Hand, arm: ArmModel) -> list[HandAction]:
    """Make the servers that franka_gripper has below the preset's name, where it has one."""
    if not arm.franka_gripper:
        return []

    def stop(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        hand.halt()
        response.success = True
        return response

    node.create_service(Trigger, arm.gripper_stop, stop)
    servers = ((GraspAction, arm.grasp_action), (MoveAction, arm.move_action), (HomingAction, arm.homing_action))
    return [server(node, hand, name) for server, name in servers]
