"""The executable `driver`: a Franka arm and hand behind the actions that the executor knows."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.errors import CoreError
from cliport_core.ros_running import run_node
from panda_driver.arm_loop import ArmLoop
from panda_driver.errors import DriverError
from panda_driver.franky_ports import FrankyArm, FrankyHand
from panda_driver.hand import Hand
from panda_driver.node_actions import ArmAction, HandAction
from panda_driver.node_parameters import DriverParameters, read_parameters
from panda_driver.ports import ArmPort, ArmState, HandPort
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.heartbeat import HeartbeatWatchdog
from sim_bridge.conversions import joint_state_to_msg, time_to_msg

_RECOVERY_TIME = 10.0  # for the arm to clear its errors [s]

Fail = Callable[[BaseException], None]
Connect = Callable[[DriverParameters], tuple[ArmPort, HandPort | None]]


def connect_franky(parameters: DriverParameters) -> tuple[ArmPort, HandPort | None]:
    """Return the connected arm, and hand where one is wanted. Raises DriverError."""
    arm = FrankyArm(parameters.address, parameters.settings)
    return arm, FrankyHand(parameters.address) if parameters.with_hand else None


class DriverNode(Node):
    """Joins the arm's and the hand's loops to their topics, actions and services.

    Raises:
        DriverError, CoreError: when a parameter cannot be used, or the arm cannot be reached.
    """

    def __init__(self, on_failure: Fail, connect: Connect = connect_franky, **options: Any) -> None:
        """Connect and begin to drive. on_failure: told, once, of what ended the driving."""
        super().__init__("panda_driver", **options)
        self._settings = parameters = read_parameters(self)
        robot = parameters.robot
        arm, hand = connect(parameters)
        self._states = self.create_publisher(JointState, topics.JOINT_STATES, 10)
        self._arm_clock = self.create_publisher(ClockMessage, topics.CLOCK, 10) if parameters.publish_clock else None
        self._published = 0.0
        self._last_fault = ""
        self.loop = ArmLoop(arm, ArmControllerConfig.for_arm(robot), self._on_state, on_failure)
        self.hand = Hand(hand, robot.hand, on_failure) if hand is not None else None
        self._arm_action = ArmAction(self, self.loop, robot.arm_action, robot.arm_joints)
        self.create_service(Trigger, "~/recover_errors", self._recover)
        if self.hand is not None:
            self._hand_action = HandAction(self, self.hand, robot.gripper_action)
            self.create_service(Trigger, "~/home_gripper", self._home)
            self.hand.start_thread()
        self._watchdog = HeartbeatWatchdog(parameters.heartbeat_timeout)
        self.create_subscription(Empty, topics.HEARTBEAT, lambda _: self._watchdog.beat(), 10)
        self.create_timer(self._watchdog.period, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.loop.start_thread()
        self.get_logger().info(f"driving the {robot.name} at {parameters.address}: {robot.arm_action}")

    def close(self) -> None:
        """Brake, let the arm hold by itself, and disconnect."""
        if self.hand is not None:
            self.hand.stop_thread()
        self.loop.stop_thread()

    def _on_state(self, state: ArmState) -> None:
        """Publish the joints; in the arm's thread."""
        if state.fault and state.fault != self._last_fault:
            self.get_logger().error(state.fault)
        self._last_fault = state.fault
        now = time.monotonic()
        if now - self._published < 0.9 / self._settings.joint_state_rate:
            return
        self._published = now
        stamp = self.get_clock().now().nanoseconds * 1e-9
        if self._arm_clock is not None:
            stamp = state.time
            self._arm_clock.publish(ClockMessage(clock=time_to_msg(stamp)))
        robot, rest = self._settings.robot, np.zeros(0)
        names, positions = robot.arm_joints, state.positions
        if self.hand is not None:
            names, rest = robot.joints, np.zeros(len(robot.finger_joints))
            positions = np.concatenate([positions, rest + self.hand.state.width / 2.0])
        velocities, efforts = np.concatenate([state.velocities, rest]), np.concatenate([state.efforts, rest])
        self._states.publish(joint_state_to_msg(names, positions, velocities, efforts, stamp))

    def _watch(self) -> None:
        """Stop the arm and the hand where the executor has fallen silent during a motion."""
        moving = self.loop.moving or (self.hand is not None and self.hand.moving)
        if not self._watchdog.tick(time.monotonic(), moving):
            return
        reason = f"heartbeat lost: nothing from the executor for {self._watchdog.timeout:g} s"
        self.get_logger().error(f"{reason}; the arm stops")
        self.loop.hold(reason)
        if self.hand is not None:
            self.hand.halt()

    def _recover(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(response, lambda: self.loop.recover(_RECOVERY_TIME), "the errors are cleared")

    def _home(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        assert self.hand is not None
        return _answer(response, self.hand.home, "the hand knows its range")


def _answer(response: Trigger.Response, do: Callable[[], None], words: str) -> Trigger.Response:
    try:
        do()
    except DriverError as error:
        response.success, response.message = False, str(error)
    else:
        response.success, response.message = True, words
    return response


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; return 0 then, 1 when the arm cannot be reached or is lost, with one line."""
    return run_node(DriverNode, (DriverError, CoreError), args, DriverNode.close)


if __name__ == "__main__":
    sys.exit(main())
