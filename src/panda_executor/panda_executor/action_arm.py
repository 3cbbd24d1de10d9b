"""The arm behind a FollowJointTrajectory action."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from control_msgs.action import FollowJointTrajectory

from panda_executor.action_call import TIME_FACTOR, TIME_SPARE, ActionCaller, ActionEnd
from panda_executor.arm_watch import ArmWatch
from panda_executor.conversions import motion_message, trajectory_goal_to_msg
from panda_executor.errors import PortError
from panda_executor.joint_tracker import JointTracker
from panda_executor.ports import MotionResult, MotionStatus, ShouldStop
from panda_executor.trajectory import JointTrajectory
from panda_model.limits import FloatArray

_POLL = 0.01  # between two looks at the joint states [s]


class ActionArm:
    """ArmPort over a controller. A motion may take TIME_FACTOR times its duration, goal_time and TIME_SPARE (ROS time).

    Args:
        on_motion: called before a goal is sent: from then on the arm counts as moving until it is measured at rest.
    """

    def __init__(
        self,
        caller: ActionCaller,
        joints: JointTracker,
        joint_names: tuple[str, ...],
        now_ns: Callable[[], int],
        watch: ArmWatch | None = None,
        on_motion: Callable[[], None] = lambda: None,
    ) -> None:
        self._caller, self._joints, self._names, self._now_ns = caller, joints, joint_names, now_ns
        self._watch, self._on_motion = watch or ArmWatch(), on_motion

    def joint_positions(self) -> FloatArray:
        """Return the measured positions (7,) [rad]. Raises PortError when they are missing or old."""
        return self._joints.arm_positions(self._now_ns())

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Follow a trajectory to its end, or cancel it when asked to stop, late, or no joint states come.

        Returns once the arm is measured at rest, or `standing` says that it is not.

        Raises:
            PortError: when the joint states end on the way; the motion is cancelled.
        """
        watch = self._watch
        goal = trajectory_goal_to_msg(
            trajectory, self._names, watch.path_tolerance, watch.goal_tolerance, watch.goal_time
        )
        began_ns: int | None = None  # when the controller took the goal: until then the arm rests

        def begin() -> None:
            nonlocal began_ns
            began_ns = self._now_ns()

        def stop() -> bool:
            now_ns = self._now_ns()
            self._joints.arm_positions(now_ns)
            if began_ns is not None:
                self._check_alive(trajectory, began_ns, now_ns)
            return should_stop()

        self._on_motion()
        timeout = TIME_FACTOR * trajectory.duration + watch.goal_time + TIME_SPARE
        try:
            end = self._caller.call(goal, timeout, stop, begin)
        except PortError:
            self._come_to_rest()  # the goal is cancelled; everything is, where the arm is not seen to rest then
            raise
        # At rest for a moment, an arm whose goal may live on does not stand.
        return self._judged(end, self._come_to_rest() and end.confirmed)

    def _check_alive(self, trajectory: JointTrajectory, began_ns: int, now_ns: int) -> None:
        """Raise PortError when the joint states stay the same although the path goes on."""
        watch = self._watch
        passed = (now_ns - began_ns) * 1e-9
        unchanged = min(self._joints.unchanged(now_ns), passed)
        if unchanged < watch.frozen:
            return
        positions = trajectory.sample(np.array([max(passed - unchanged, 0.0), passed - watch.frozen / 2.0]))[0]
        if passed < trajectory.duration and float(np.abs(positions[1] - positions[0]).max()) > watch.frozen_way:
            self._joints.distrust()
            raise PortError(
                f"the joint states have been the same for {unchanged:.1f} s of a motion (at most {watch.frozen:g} s); "
                "does something stamp old ones anew?"
            )

    def _come_to_rest(self) -> bool:
        deadline = time.monotonic() + self._watch.standstill_time
        while not self._joints.is_still(self._now_ns()):
            if time.monotonic() > deadline:
                self._caller.cancel_all()
                return False
            time.sleep(_POLL)
        return True

    @staticmethod
    def _judged(end: ActionEnd, standing: bool) -> MotionResult:
        if end.result is None or end.message:
            return MotionResult(end.status, end.message, standing)
        if end.result.error_code != FollowJointTrajectory.Result.SUCCESSFUL:
            # Some controllers end a goal well and say only here that it was not reached.
            status = MotionStatus.ABORTED if end.status is MotionStatus.SUCCEEDED else end.status
            if end.result.error_code == FollowJointTrajectory.Result.GOAL_TOLERANCE_VIOLATED:
                status = MotionStatus.OFF_GOAL
            return MotionResult(status, motion_message(end.result), standing)
        return MotionResult(end.status, end.result.error_string, standing)
