"""An arm behind the executor's actions that does one thing wrong, where the test says so."""

from __future__ import annotations

import threading
import time
from enum import Enum
from typing import Any

import numpy as np
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.action import CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from sensor_msgs.msg import JointState

from cliport_core import topics
from cliport_core.ros_action_server import ThreadedActionServer
from panda_model import ArmModel
from sim_bridge import conversions
from sim_bridge.control.trajectory_goal import GoalRejectedError, validate_goal

_STEP = 0.01  # [s]


class Fault(Enum):
    """What such an arm can do wrong."""

    NONE = "nothing"
    ANY_TIMES = "accepts times that do not increase"
    ANY_JOINTS = "accepts other joints' names"
    NO_LIMITS = "accepts positions outside the limits"
    ANY_START = "accepts a start far from the arm"
    NEVER_ENDS = "never ends a goal"
    LATE = "takes five times as long"
    IDLE = "says that it is done and has not moved"
    ASTRAY = "leaves the path on the way"
    DEAF = "ignores a cancel"
    COASTS = "says canceled and goes on"
    BOTH = "says of two goals at once that both are done"
    HALF_WIDTH = "reports half of the width"
    FULL_FINGERS = "has each finger's joint at the full width"
    WIDE_HAND = "takes a width beyond its hand"
    RARE = "publishes joint states rarely"
    OLD = "stamps joint states with an old time"
    LOST_JOINT = "leaves a joint out"


class FakeArmNode(Node):
    """The arm; goals are followed in a straight line between points."""

    def __init__(self, robot: ArmModel, fault: Fault, **options: Any) -> None:
        super().__init__("fake_arm", **options)
        self.robot, self.fault = robot, fault
        self.positions, self.width = np.array(robot.ready), 0.04
        self._running = threading.Lock()
        self._stop = threading.Event()
        self._states = self.create_publisher(JointState, topics.JOINT_STATES, 10)
        self.create_timer(0.3 if fault is Fault.RARE else 0.01, self._publish)
        group = ReentrantCallbackGroup()
        self._arm = ThreadedActionServer(
            self, FollowJointTrajectory, robot.arm_action, execute_callback=self._follow,
            goal_callback=self._on_goal, cancel_callback=self._on_cancel, callback_group=group,
        )  # fmt: skip
        self._hand = ThreadedActionServer(
            self, GripperCommand, robot.gripper_action, execute_callback=self._grip,
            goal_callback=self._on_grip, callback_group=group,
        )  # fmt: skip

    def _publish(self) -> None:
        finger = self.width * (1.0 if self.fault is Fault.FULL_FINGERS else 0.5)
        names, positions = list(self.robot.joints), [*self.positions.tolist(), finger, finger]
        if self.fault is Fault.LOST_JOINT:
            names, positions = names[1:], positions[1:]
        stamp = self.get_clock().now().nanoseconds * 1e-9 - (3.0 if self.fault is Fault.OLD else 0.0)
        self._states.publish(conversions.joint_state_to_msg(names, positions, [], [], stamp))

    def _on_goal(self, request: FollowJointTrajectory.Goal) -> GoalResponse:
        goal, robot = conversions.trajectory_goal_from_msg(request), self.robot
        wrong = ""
        try:
            validate_goal(goal, robot.arm_joints, 0.0)
        except GoalRejectedError as error:
            wrong = str(error)
        rows = np.array([point.positions for point in goal.points])
        checks = {
            Fault.ANY_TIMES: "increase" in wrong,
            Fault.ANY_JOINTS: "each joint" in wrong,
            Fault.NO_LIMITS: not robot.limits.contains(rows),
            Fault.ANY_START: bool(np.abs(rows[0] - self.positions).max() > 0.05),
            Fault.BOTH: self._running.locked(),
        }
        refused = [fault for fault, found in checks.items() if found and fault is not self.fault]
        return GoalResponse.REJECT if refused else GoalResponse.ACCEPT

    def _on_cancel(self, _: Any) -> CancelResponse:
        if self.fault is Fault.DEAF:
            return CancelResponse.REJECT
        if self.fault is not Fault.COASTS:
            self._stop.set()
        return CancelResponse.ACCEPT

    def _follow(self, handle: Any) -> FollowJointTrajectory.Result:
        with self._running:
            self._stop.clear()
            goal = conversions.trajectory_goal_from_msg(handle.request)
            if self.fault is Fault.COASTS:
                threading.Thread(target=self._move, args=(goal, handle, False), daemon=True).start()
                self._end_when_asked(handle, goal.points[-1].time)
                return FollowJointTrajectory.Result()
            if self.fault is not Fault.IDLE:
                self._move(goal, handle, True)
            while self.fault is Fault.NEVER_ENDS and not self._stop.wait(0.05):
                pass
            self._end(handle)
        return FollowJointTrajectory.Result()

    def _move(self, goal: Any, handle: Any, heeds: bool) -> None:
        times = np.array([point.time for point in goal.points]) * (5.0 if self.fault is Fault.LATE else 1.0)
        rows = np.array([point.positions for point in goal.points])
        begin = time.monotonic()
        passed = 0.0
        while passed < times[-1] and not (heeds and self._stop.is_set()):
            passed = time.monotonic() - begin
            row = np.array([np.interp(passed, times, rows[:, joint]) for joint in range(7)])
            if self.fault is Fault.ASTRAY:
                row[2] += 0.1 * np.sin(np.pi * min(passed / times[-1], 1.0))
            self.positions = row
            time.sleep(_STEP)

    def _end_when_asked(self, handle: Any, most: float) -> None:
        deadline = time.monotonic() + most
        while not handle.is_cancel_requested and time.monotonic() < deadline:
            time.sleep(_STEP)
        handle.canceled() if handle.is_cancel_requested else handle.succeed()

    def _end(self, handle: Any) -> None:
        deadline = time.monotonic() + 5.0
        while self._stop.is_set() and not handle.is_cancel_requested and time.monotonic() < deadline:
            time.sleep(_STEP)
        handle.canceled() if handle.is_cancel_requested else handle.succeed()

    def _on_grip(self, request: GripperCommand.Goal) -> GoalResponse:
        beyond = 2.0 * request.command.position > self.robot.hand.opening + 1e-6
        return GoalResponse.REJECT if beyond and self.fault is not Fault.WIDE_HAND else GoalResponse.ACCEPT

    def _grip(self, handle: Any) -> GripperCommand.Result:
        self.width = min(2.0 * handle.request.command.position, self.robot.hand.opening)
        handle.succeed()
        reported = self.width * (0.5 if self.fault is Fault.HALF_WIDTH else 1.0)
        return GripperCommand.Result(position=reported, reached_goal=True)
