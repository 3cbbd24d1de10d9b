"""The arm's and the gripper's controllers, as the ports that a runner moves."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from control_msgs.action import FollowJointTrajectory, GripperCommand
from franka_msgs.action import Grasp, Move
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from panda_executor.action_arm import ActionArm
from panda_executor.action_call import ActionCaller
from panda_executor.action_franka_gripper import FrankaGripper
from panda_executor.action_gripper import ActionGripper
from panda_executor.joint_tracker import JointTracker
from panda_executor.node_parameters import NodeParameters
from panda_executor.work_pulse import WorkPulse


class Controllers:
    """Clients of both controllers, and what the joint states say of them.

    Args:
        on_motion: called before the arm is told to move.
    """

    def __init__(
        self,
        node: Node,
        parameters: NodeParameters,
        joints: JointTracker,
        on_motion: Callable[[], None],
        group: CallbackGroup,
    ) -> None:
        robot = parameters.robot
        self.pulse = WorkPulse(time.monotonic, parameters.work_silence)
        self._arm_caller = ActionCaller(node, FollowJointTrajectory, robot.arm_action, group, self.pulse)
        self._gripper_callers = [ActionCaller(node, GripperCommand, robot.gripper_action, group, self.pulse)]

        def now_ns() -> int:
            return int(node.get_clock().now().nanoseconds)

        self.arm = ActionArm(self._arm_caller, joints, robot.arm_joints, now_ns, parameters.watch, on_motion)
        self.gripper: ActionGripper | FrankaGripper
        if robot.franka_gripper:
            grasp = ActionCaller(node, Grasp, robot.grasp_action, group, self.pulse)
            move = ActionCaller(node, Move, robot.move_action, group, self.pulse)
            self.gripper = FrankaGripper(grasp, move, joints, now_ns, robot.hand)
            self._gripper_callers += [grasp, move]
        else:
            held_from = math.inf if robot.gripper_reports_stalled else parameters.config.missed_width
            full = robot.gripper_reports_full_width
            self.gripper = ActionGripper(self._gripper_callers[0], joints, now_ns, full, held_from)

    def stop(self) -> None:
        """Cancel all goals of both controllers, whoever sent them."""
        self.gripper.stop()
        self._arm_caller.cancel_all()
        for caller in self._gripper_callers:
            caller.cancel_all()

    @property
    def arm_ready(self) -> bool:
        """True if the arm's action server is there."""
        return self._arm_caller.is_ready()

    @property
    def gripper_ready(self) -> bool:
        """True if the gripper's action servers are there: of franka_msgs those where it offers them."""
        used = self._gripper_callers[1:] or self._gripper_callers
        return all(caller.is_ready() for caller in used)
