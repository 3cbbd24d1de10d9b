"""The executable `driver`: a Franka arm and hand behind the actions that the executor knows."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from std_msgs.msg import Empty
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.errors import CoreError
from cliport_core.ros_running import run_node
from panda_driver.arm_loop import ArmLoop
from panda_driver.connecting import connected_within
from panda_driver.errors import DriverError, HandFaultError
from panda_driver.franky_ports import FrankyArm, FrankyHand
from panda_driver.hand import Hand
from panda_driver.node_actions import ArmAction, HandAction
from panda_driver.node_franka_hand import serve_franka_hand
from panda_driver.node_parameters import DriverParameters, read_parameters
from panda_driver.node_states import StatePublisher
from panda_driver.ports import ArmPort, HandPort
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.heartbeat import HeartbeatWatchdog

_RECOVERY_TIME = 10.0  # for the arm to clear its errors [s]

Fail = Callable[[BaseException], None]
ConnectHand = Callable[[], HandPort]
Connect = Callable[[DriverParameters], tuple[ArmPort, ConnectHand | None]]


def connect_franky(parameters: DriverParameters) -> tuple[ArmPort, ConnectHand | None]:
    """Return the connected arm, and what connects the hand where one is wanted. Raises DriverError."""
    address, timeout = parameters.address, parameters.connect_timeout
    arm = connected_within(timeout, "arm", address, lambda: FrankyArm(address, parameters.settings))

    def connect_hand() -> FrankyHand:
        return connected_within(timeout, "hand", address, lambda: FrankyHand(address))

    return arm, connect_hand if parameters.with_hand else None


class DriverNode(Node):
    """Joins the arm's and the hand's loops to their topics, actions and services.

    Raises:
        DriverError, CoreError: when a parameter cannot be used, or the arm cannot be reached.
    """

    def __init__(self, on_failure: Fail, connect: Connect = connect_franky, **options: Any) -> None:
        """Connect and begin to drive. on_failure: told, once, of what ended the driving."""
        super().__init__("panda_driver", **options)
        parameters = read_parameters(self)
        robot = parameters.robot
        arm, connect_hand = connect(parameters)
        self.hand = Hand(connect_hand, robot.hand, self._on_hand_loss) if connect_hand is not None else None
        rate, own_time = parameters.joint_state_rate, parameters.publish_clock
        self._states = StatePublisher(self, robot, self.hand, rate, own_time)
        self.loop = ArmLoop(arm, ArmControllerConfig.for_arm(robot), self._states.take, on_failure)
        self._arm_action = ArmAction(self, self.loop, robot.arm_action, robot.arm_joints)
        self.create_service(Trigger, "~/recover_errors", self._recover)
        if self.hand is not None:
            self._hand_actions = [HandAction(self, self.hand, robot.gripper_action)]
            self._hand_actions += serve_franka_hand(self, self.hand, robot)
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
        self._states.stop_thread()

    def _on_hand_loss(self, words: str) -> None:
        self.get_logger().error(f"{words}; the arm goes on without it")

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
        return _answer(response, self._home_hand, "the hand knows its range")

    def _home_hand(self) -> None:
        """Home the hand; this node's thread waits for it, and would not see a heartbeat that ends meanwhile."""
        if self.loop.moving:
            raise HandFaultError("the arm is moving: wait until it stands still")
        assert self.hand is not None
        self.hand.home()


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
