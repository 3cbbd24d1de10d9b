"""The arm under test behind its actions and joint states."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.task import Future
from rclpy.time import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_core import topics
from panda_driver.conformance.plan import MotionPlan
from panda_driver.conformance.subject import Bounds, End, Sample
from panda_model import ArmModel

_KEPT = 60_000  # joint states
_POLL = 0.005  # [s]
_ENDS = {GoalStatus.STATUS_SUCCEEDED: End.SUCCEEDED, GoalStatus.STATUS_CANCELED: End.CANCELED}


class SentGoal:
    """RunningGoal of one action client; everything of rclpy happens in the thread that spins the node."""

    def __init__(self, node: Node, client: ActionClient, message: Any) -> None:
        self.accepted: bool | None = None
        self.end: End | None = None
        self.ended_at, self.words, self.width, self.stalled = 0.0, "", float("nan"), False
        self._node, self._client, self._message, self._handle = node, client, message, None
        self._post(self._send)

    def cancel(self) -> None:
        """Ask the server to end the goal."""
        if self._handle is not None:
            self._post(self._handle.cancel_goal_async)

    def _post(self, function: Callable[[], object]) -> None:
        assert self._node.executor is not None
        self._node.executor.create_task(function)

    def _send(self) -> None:
        self._client.send_goal_async(self._message).add_done_callback(self._on_answer)

    def _on_answer(self, future: Future) -> None:
        handle = future.result()
        if handle is None or not handle.accepted:
            self._finish(End.REJECTED)
            self.accepted = False
            return
        self._handle = handle
        handle.get_result_async().add_done_callback(self._on_result)
        self.accepted = True

    def _on_result(self, future: Future) -> None:
        answer = future.result()
        result = answer.result
        self.words = getattr(result, "error_string", "")
        self.width, self.stalled = getattr(result, "position", float("nan")), getattr(result, "stalled", False)
        self._finish(_ENDS.get(answer.status, End.ABORTED))

    def _finish(self, end: End) -> None:
        self.ended_at = self._node.get_clock().now().nanoseconds * 1e-9
        self.end = end  # last: another thread waits for it


class ArmClient:
    """Subject of the checks over ROS. The node must be spun by another thread than the one that checks."""

    def __init__(self, node: Node, robot: ArmModel, bounds: Bounds) -> None:
        self._node, self.robot, self.bounds = node, robot, bounds
        self._samples: deque[Sample] = deque(maxlen=_KEPT)
        self._lock = threading.Lock()
        self._fingers = np.full(2, np.nan)
        self._arm = ActionClient(node, FollowJointTrajectory, robot.arm_action)
        self._hand = ActionClient(node, GripperCommand, robot.gripper_action)
        node.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, qos_profile_sensor_data)

    def missing(self, seconds: float, with_hand: bool) -> list[str]:
        """Wait at most so long [s] for both actions and the joint states; return the names of what is not there."""

        def absent() -> list[str]:
            names = [] if self._arm.server_is_ready() else [self.robot.arm_action]
            if with_hand and not self._hand.server_is_ready():
                names.append(self.robot.gripper_action)
            return names if self._samples else [*names, topics.JOINT_STATES]

        self.wait(lambda: not absent(), seconds)
        return absent()

    def now(self) -> float:
        """Return the node's time [s]."""
        return float(self._node.get_clock().now().nanoseconds * 1e-9)

    def samples(self, since: float) -> list[Sample]:
        """Return the joint states that came from `since` on."""
        with self._lock:
            return [sample for sample in self._samples if sample.came >= since]

    def wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait for a condition [s, wall clock]."""
        deadline = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > deadline:
                return False
            time.sleep(_POLL)
        return True

    def follow(self, joints: Sequence[str], plan: MotionPlan) -> SentGoal:
        """Send a trajectory that begins now."""
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = list(joints)
        for moment, positions, velocities in zip(plan.times, plan.positions, plan.velocities):
            point = JointTrajectoryPoint(positions=positions.tolist(), velocities=velocities.tolist())
            point.time_from_start = Duration(seconds=float(moment)).to_msg()
            goal.trajectory.points.append(point)
        return SentGoal(self._node, self._arm, goal)

    def grip(self, position: float, effort: float) -> SentGoal:
        """Send a gripper goal: half a width [m], and a force [N]."""
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = float(position), float(effort)
        return SentGoal(self._node, self._hand, goal)

    def _on_joints(self, message: JointState) -> None:
        seen = dict(zip(message.name, message.position))
        if all(name in seen for name in self.robot.finger_joints):  # a hand may publish for itself
            self._fingers = np.array([seen[name] for name in self.robot.finger_joints])
        if not all(name in seen for name in self.robot.arm_joints):
            return
        arm = np.array([seen[name] for name in self.robot.arm_joints])
        stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        with self._lock:
            self._samples.append(Sample(stamp, self.now(), arm, self._fingers))
