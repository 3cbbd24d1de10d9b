"""The simulator as a ROS 2 node: the interfaces of a real arm and camera, and services to set a scene."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Empty

from cliport_core.ros_running import run_node
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.gripper_controller import GripperConfig, GripperController
from sim_bridge.control.heartbeat import HeartbeatWatchdog
from sim_bridge.control.joint_trajectory_controller import JointTrajectoryController
from sim_bridge.control.trajectory_log import TrajectoryLog
from sim_bridge.errors import SimBridgeError
from sim_bridge.mirror import Mirror
from sim_bridge.node_camera import CameraPublisher
from sim_bridge.node_controllers import ArmAction, GripperAction, serve_franka_hand
from sim_bridge.node_faults import FaultInjection
from sim_bridge.node_mirror import hear
from sim_bridge.node_parameters import SimParameters, declare_parameters
from sim_bridge.node_services import SceneServices
from sim_bridge.node_state import StatePublisher
from sim_bridge.pacing import PaceWatch, RealTimePacer
from sim_bridge.rendering.camera import CameraConfig, SimCamera
from sim_bridge.rendering.mounting import load_camera
from sim_bridge.robot import ROBOT
from sim_bridge.scene import reset_scene
from sim_bridge.sim_loop import SimLoop
from sim_bridge.world import SimWorld

_PACE_S, _PACE_SAID_S = 10.0, 120.0  # between two looks at the pace, and between two words about it


class SimNode(Node):  # type: ignore[misc]
    """Joins a simulation loop to its topics, actions and services."""

    def __init__(self, on_failure: Callable[[BaseException], None]) -> None:
        """Make the world and its first scene. Raises SimBridgeError for parameters that cannot be used."""
        super().__init__("sim_bridge")
        parameters, noise = declare_parameters(self)
        log = TrajectoryLog(parameters.trajectory_log)
        world = SimWorld()
        self._world = world
        task = reset_scene(world, parameters.task, parameters.split, parameters.seed, parameters.instruction)
        arm = parameters.arm
        if arm.name != ROBOT.name:
            self.get_logger().warning(f"preset {arm.name} is simulated with the body of the {ROBOT.name}")
        found = load_camera(parameters.camera_mounting)
        camera = SimCamera(
            CameraConfig(
                found.intrinsics,
                found.camera_in_base,
                noise,
                n_threads=parameters.render_threads,
                held_board=parameters.board,
                reuse_still=True,
            )
        )
        mirror = Mirror(world) if parameters.mirror else None
        self.loop = SimLoop(
            world,
            mirror.arm if mirror else JointTrajectoryController(ArmControllerConfig.for_arm(arm)),
            mirror.hand if mirror else GripperController(_gripper_config(parameters)),
            mirror or RealTimePacer(world.dt, parameters.real_time_factor),
            lambda error: on_failure(SimBridgeError(f"the simulation failed: {error}")),
        )
        faults = FaultInjection(self, self.loop)
        self._state = StatePublisher(self, self.loop, camera, parameters, faults)
        self._camera = CameraPublisher(self, self.loop, camera, faults, parameters.camera_rate, parameters.camera_frame)
        if mirror:
            hear(self, parameters.mirror, arm, mirror)
        else:
            self.loop.hold_while(self._camera.is_behind)
            self._watch_pace(parameters.real_time_factor)
            self._arm = ArmAction(self, self.loop, parameters.arm_action, faults, log)
            self._gripper = GripperAction(self, self.loop, parameters.gripper_action, faults)
            self._franka_hand = serve_franka_hand(self, self.loop, arm.with_gripper(parameters.gripper_action), faults)
        self._scenes = SceneServices(self, self.loop, task, parameters.seed)
        self._watch(parameters)
        self.loop.start()
        self._camera.start()
        self.get_logger().info(f"scene: {task.name} {task.split.value} {parameters.seed}: {task.instruction}")

    def close(self) -> None:
        """End the threads, then the world."""
        self.loop.stop()
        self._camera.stop()
        self._world.close()

    def _watch(self, parameters: SimParameters) -> None:
        """Hold the arm when the one who drives it falls silent."""
        self._watchdog = HeartbeatWatchdog(parameters.heartbeat_timeout)
        group = MutuallyExclusiveCallbackGroup()
        self.create_subscription(
            Empty, parameters.heartbeat_topic, lambda _: self._watchdog.beat(), 10, callback_group=group
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._watchdog.period, self._check_heartbeat, callback_group=group, clock=steady)

    def _watch_pace(self, factor: float) -> None:
        watch = PaceWatch(factor)

        def look() -> None:
            if words := watch.look(self.loop.world.time, time.monotonic()):
                self.get_logger().info(words, throttle_duration_sec=_PACE_SAID_S)

        self.create_timer(_PACE_S, look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _check_heartbeat(self) -> None:
        loop = self.loop
        moving = loop.arm.active is not None or loop.gripper.active is not None
        if not self._watchdog.tick(time.monotonic(), moving):
            return
        reason = f"heartbeat lost: nothing from the executor for {self._watchdog.timeout:g} s"
        self.get_logger().error(f"{reason}; the arm holds")

        def hold() -> None:
            loop.arm.hold(reason)
            loop.gripper.hold(reason)

        with suppress(SimBridgeError):  # the loop has ended: nothing moves any more
            loop.call(hold)


def _gripper_config(parameters: SimParameters) -> GripperConfig:
    return GripperConfig(
        epsilon_inner=parameters.grasp_epsilon_inner,
        epsilon_outer=parameters.grasp_epsilon_outer,
        franka_quirks=parameters.franka_quirks,
        fault=parameters.fault_of_hand,
    )


def main(args: list[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; 0 then, 1 when the node cannot start or its simulation fails."""
    return run_node(SimNode, (SimBridgeError, RuntimeError, ValueError), args, SimNode.close)


if __name__ == "__main__":
    sys.exit(main())
