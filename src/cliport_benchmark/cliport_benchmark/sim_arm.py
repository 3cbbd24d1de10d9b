"""The executor's arm and gripper over the simulator's controllers, without ROS: they step the world."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from panda_executor.ports import GripperResult, MotionResult, MotionStatus, ShouldStop
from panda_executor.trajectory import JointTrajectory
from sim_bridge.control import (
    ErrorCode,
    GoalRejectedError,
    GoalStatus,
    GripperController,
    GripperGoal,
    GripperGoalError,
    JointTrajectoryController,
    TrajectoryGoal,
)
from sim_bridge.world import SimWorld

_GOAL_TIME = 1.0  # by which the arm may settle after a trajectory's end [s]
_OVERTIME = 3.0  # simulated time after which a motion is given up, beyond what it should take [s]
_GRIPPER_TIME = 5.0  # [s]


class SimMotion:
    """One world with its two controllers, stepped together as the simulator's node does.

    on_tick: called after every step, as by a film camera.
    """

    def __init__(self, world: SimWorld, on_tick: Callable[[], None] | None = None) -> None:
        self.world = world
        self.on_tick = on_tick
        self.arm = JointTrajectoryController()
        self.gripper = GripperController()
        self._ticks = 0

    @property
    def time(self) -> float:
        """Controllers' time [s]: it begins with the scene, so that scenes before it cannot change how it rounds."""
        return self._ticks * self.world.dt

    def tick(self) -> None:
        """One control cycle and one physics step."""
        now, state = self.time, self.world.panda.state()
        joints = self.arm.update(now, state)
        fingers = self.gripper.update(now, state)
        self.world.panda.command(joints.positions, joints.velocities)
        self.world.panda.command_fingers(fingers.width, fingers.max_effort)
        self.world.step()
        self._ticks += 1
        if self.on_tick is not None:
            self.on_tick()

    def rest(self, seconds: float) -> None:
        """Let the world go on while the arm holds."""
        for _ in range(round(seconds / self.world.dt)):
            self.tick()

    def reset(self) -> None:
        """Forget motions: the world was reset."""
        self.arm.reset()
        self.gripper.reset()
        self._ticks = 0


class SimArmPort:
    """panda_executor's ArmPort."""

    def __init__(self, motion: SimMotion) -> None:
        self._motion = motion

    def joint_positions(self) -> npt.NDArray[np.float64]:
        """Return the joints' positions (7,) [rad]."""
        return self._motion.world.panda.state().positions

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Follow the trajectory in simulated time."""
        motion, controller = self._motion, self._motion.arm
        goal = TrajectoryGoal.from_arrays(
            trajectory.joint_names,
            trajectory.times,
            trajectory.positions,
            trajectory.velocities,
            trajectory.accelerations,
            goal_time_tolerance=_GOAL_TIME,
        )
        try:
            execution = controller.start(goal, motion.time)
        except GoalRejectedError as error:
            return MotionResult(MotionStatus.REJECTED, str(error))
        give_up = motion.time + trajectory.duration + _OVERTIME
        while not execution.done:
            if should_stop():
                controller.cancel()
            if motion.time > give_up:
                controller.hold("took too long")
                return MotionResult(MotionStatus.TIMED_OUT, f"not done {_OVERTIME} s after its end")
            motion.tick()
        if execution.error_code is ErrorCode.GOAL_TOLERANCE_VIOLATED:
            return MotionResult(MotionStatus.OFF_GOAL, execution.error_string)
        return MotionResult(_MOTION_STATUS[execution.status], execution.error_string)


class SimGripperPort:
    """panda_executor's GripperPort; widths are full ones."""

    def __init__(self, motion: SimMotion) -> None:
        self._motion = motion

    def width(self) -> float:
        """Return the distance between the fingers [m]."""
        return self._motion.world.panda.state().width

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        """Open or close in simulated time."""
        motion, controller = self._motion, self._motion.gripper
        try:
            execution = controller.start(GripperGoal(width / 2.0, max_effort), motion.time)
        except GripperGoalError as error:
            return GripperResult(self.width(), False, False, MotionStatus.REJECTED, str(error))
        give_up = motion.time + _GRIPPER_TIME
        while not execution.done:
            if should_stop():
                controller.cancel()
            elif motion.time > give_up:
                controller.hold("took too long")
                message = f"the hand did not arrive in {_GRIPPER_TIME} s"
                return GripperResult(self.width(), False, False, MotionStatus.TIMED_OUT, message)
            motion.tick()
        result = execution.result
        stalled, reached = (False, False) if result is None else (result.stalled, result.reached_goal)
        return GripperResult(self.width(), stalled, reached, _MOTION_STATUS[execution.status], execution.message)

    def stop(self) -> None:
        """Hold the present width."""
        self._motion.gripper.cancel()


_MOTION_STATUS = {
    GoalStatus.SUCCEEDED: MotionStatus.SUCCEEDED,
    GoalStatus.CANCELED: MotionStatus.CANCELLED,
    GoalStatus.ABORTED: MotionStatus.ABORTED,
}
