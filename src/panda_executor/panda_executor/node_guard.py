"""The executable `guard`: cancels everything at the controllers when nobody owns the motion any more."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from cliport_core import topics
from cliport_core.errors import CoreError
from cliport_core.messages import stamp_from_msg
from cliport_core.ros_running import run_node
from panda_executor.action_call import cancel_service
from panda_executor.errors import ExecutorError
from panda_executor.guard import Fault, Guard, GuardConfig
from panda_executor.guard_watch import GUARD_STATUS
from panda_executor.parameter_checks import not_negative, positive
from panda_model.ros_parameters import declare_robot

_PERIOD = 0.02  # [s]
_SAY_AGAIN = 5.0  # between two times that the same line is said; the cancels go on [s]


class GuardNode(Node):
    """The node: it feeds a `Guard` with what it hears, and cancels when that one says so.

    Raises:
        ExecutorError, CoreError: when a parameter cannot be used.
    """

    def __init__(self, **options: Any) -> None:
        """Begin to watch. options: of rclpy's Node."""
        super().__init__("panda_guard", **options)
        robot = declare_robot(self)
        arm_action = str(self.declare_parameter("arm_action", "").value) or robot.arm_action
        gripper_action = str(self.declare_parameter("gripper_action", "").value)
        robot = replace(robot, arm_action=arm_action).with_gripper(gripper_action)
        arm_joints = [str(name) for name in self.declare_parameter("arm_joints", list(robot.arm_joints)).value or ()]
        self._guard = Guard(self._read_config(), _PERIOD, arm_joints)
        services = [cancel_service(name) for name in robot.motion_actions]
        self._cancels = {service: self.create_client(CancelGoal, service) for service in services}
        self.create_subscription(Empty, topics.HEARTBEAT, lambda _: self._guard.on_heartbeat(), 10)
        self.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, qos_profile_sensor_data)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        self._last: Fault | None = None
        self._said, self._said_at = "", -math.inf
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_PERIOD, self._tick, clock=steady)
        self.create_timer(1.0, self._report, clock=steady)

    def _read_config(self) -> GuardConfig:
        """Declare and read the limits. Raises ExecutorError on a value out of range."""
        config = GuardConfig()

        def get(name: str, default: float) -> Any:
            return self.declare_parameter(name, default).value

        return GuardConfig(
            silence=positive(get, "silence", config.silence),
            joint_silence=positive(get, "joint_silence", config.joint_silence),
            max_age=positive(get, "max_joint_age", config.max_age),
            max_ahead=not_negative(get, "max_ahead", config.max_ahead),
        )

    def _on_joints(self, message: JointState) -> None:
        age = (self.get_clock().now().nanoseconds - stamp_from_msg(message.header.stamp)) * 1e-9
        self._guard.on_joints(message.name, message.position, age)

    def _tick(self) -> None:
        fault = self._guard.tick(time.monotonic())
        if fault is None:
            return
        self._last = fault
        missing = []
        for service, client in self._cancels.items():
            if client.service_is_ready():
                client.call_async(CancelGoal.Request())  # a zero id and stamp: every goal
            else:
                missing.append(service)
        words = "all goals are cancelled at the controllers"
        if missing:
            words = f"cannot cancel at {', '.join(missing)}: no such service; use the arm's own stop"
        self._say(f"{fault.value}: {words}")

    def _say(self, line: str) -> None:
        """Log a line as an error; the same one no more often than each _SAY_AGAIN seconds."""
        now = time.monotonic()
        if line != self._said or now - self._said_at > _SAY_AGAIN:
            self._said, self._said_at = line, now
            self.get_logger().error(line)

    def _report(self) -> None:
        words = "watching" if self._last is None else f"last cancelled everything because {self._last.value}"
        level = DiagnosticStatus.OK if self._last is None else DiagnosticStatus.WARN
        status = DiagnosticStatus(level=level, name=GUARD_STATUS, message=words, hardware_id="arm")
        message = DiagnosticArray(status=[status])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def main(args: list[str] | None = None) -> int:
    """Run the guard; return the exit status."""
    return run_node(lambda _: GuardNode(), (ExecutorError, CoreError), args)
