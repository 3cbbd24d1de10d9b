"""The arm behind a FollowJointTrajectory action."""

from __future__ import annotations

from collections.abc import Callable

from control_msgs.action import FollowJointTrajectory

from panda_executor.action_call import ActionCaller
from panda_executor.conversions import motion_message, trajectory_to_msg
from panda_executor.joint_tracker import JointTracker
from panda_executor.ports import MotionResult, MotionStatus, ShouldStop
from panda_executor.trajectory import JointTrajectory
from panda_model.limits import FloatArray


class ActionArm:
    """ArmPort over a controller. A motion may take 1.2 times its duration and 0.5 s, in ROS time."""

    def __init__(
        self,
        caller: ActionCaller,
        joints: JointTracker,
        joint_names: tuple[str, ...],
        now_ns: Callable[[], int],
    ) -> None:
        self._caller, self._joints, self._names, self._now_ns = caller, joints, joint_names, now_ns

    def joint_positions(self) -> FloatArray:
        """Return the measured positions (7,) [rad]. Raises PortError when they are missing or old."""
        return self._joints.arm_positions(self._now_ns())

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Follow a trajectory to its end, or cancel it (the controller then holds) when asked to stop or late."""
        goal = FollowJointTrajectory.Goal(trajectory=trajectory_to_msg(trajectory, self._names))
        end = self._caller.call(goal, 1.2 * trajectory.duration + 0.5, should_stop)
        if end.result is None or end.message:
            return MotionResult(end.status, end.message)
        if end.result.error_code != FollowJointTrajectory.Result.SUCCESSFUL:
            # Some controllers end a goal well and say only here that it was not reached.
            status = MotionStatus.ABORTED if end.status is MotionStatus.SUCCEEDED else end.status
            return MotionResult(status, motion_message(end.result))
        return MotionResult(end.status, end.result.error_string)
