"""The controllers of the arm and of the hand, for whoever steps a world."""

from sim_bridge.control.arm_reflex import ArmControllerConfig, JointCommand
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import (
    GripperCommand,
    GripperConfig,
    GripperController,
    GripperExecution,
    GripperGoal,
    GripperGoalError,
    GripperResult,
    HandFault,
    HandTask,
)
from sim_bridge.control.joint_trajectory_controller import (
    JointTrajectoryController,
    TrajectoryExecution,
    TrajectoryFeedback,
)
from sim_bridge.control.trajectory_goal import (
    ErrorCode,
    GoalRejectedError,
    JointTolerance,
    TrajectoryGoal,
    TrajectoryPoint,
)

__all__ = [
    "ArmControllerConfig",
    "ErrorCode",
    "GoalRejectedError",
    "GoalStatus",
    "GripperCommand",
    "GripperConfig",
    "GripperController",
    "GripperExecution",
    "GripperGoal",
    "GripperGoalError",
    "GripperResult",
    "HandFault",
    "HandTask",
    "JointCommand",
    "JointTolerance",
    "JointTrajectoryController",
    "TrajectoryExecution",
    "TrajectoryFeedback",
    "TrajectoryGoal",
    "TrajectoryPoint",
]
