"""Publishes what does not need an answer: the clock, the joints and where the camera is."""

from __future__ import annotations

import numpy as np
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from cliport_core import topics
from panda_model import ARM_DOF
from sim_bridge.control.gripper_controller import HandFault
from sim_bridge.conversions import joint_state_to_msg, time_to_msg, transform_to_msg
from sim_bridge.node_faults import FaultInjection
from sim_bridge.node_parameters import SimParameters
from sim_bridge.panda import ArmState
from sim_bridge.rendering.camera import SimCamera
from sim_bridge.sim_loop import SimLoop


class StatePublisher:
    """/clock and /joint_states at their rates of simulated time, /tf_static once where that is wanted.

    While joint states are spoiled by a fault, or another arm's are mirrored, the true ones are on
    topics.SIM_TRUE_JOINTS, for those who test it; an arm that mirrors publishes nothing else of itself.
    """

    def __init__(
        self, node: Node, loop: SimLoop, camera: SimCamera, parameters: SimParameters, faults: FaultInjection
    ) -> None:
        self._faults = faults
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._loop, self._names = loop, parameters.arm.joints
        self._clock = node.create_publisher(Clock, topics.CLOCK, 10)
        self._joints = node.create_publisher(JointState, topics.JOINT_STATES, 10)
        self._truth = node.create_publisher(JointState, topics.SIM_TRUE_JOINTS, 10)
        if parameters.publish_camera_pose:
            self._transforms = node.create_publisher(TFMessage, topics.TF_STATIC, latched)
            place = transform_to_msg(camera.camera_in_base, parameters.base_frame, parameters.camera_frame, 0.0)
            self._transforms.publish(TFMessage(transforms=[place]))
        self._mirrors = bool(parameters.mirror)
        if not self._mirrors:
            loop.every(1.0 / parameters.clock_rate, self._publish_clock)
        loop.every(1.0 / parameters.joint_state_rate, self._publish_joints)

    def _publish_clock(self, time: float, state: ArmState) -> None:
        self._clock.publish(Clock(clock=time_to_msg(max(time + self._faults.clock_shift, 0.0))))

    def _publish_joints(self, time: float, state: ArmState) -> None:
        time = max(time + self._faults.clock_shift, 0.0)
        if self._mirrors or self._faults.states.any:
            self._truth.publish(self._message(time, state))
        if self._mirrors:
            return
        spoiled = self._faults.states.spoiled(time, state)
        if spoiled is not None:
            self._joints.publish(self._message(*spoiled))

    def _message(self, time: float, state: ArmState) -> JointState:
        lost = self._loop.gripper.fault is HandFault.LOST
        rows = (
            np.concatenate([state.positions, state.finger_positions]),
            np.concatenate([state.velocities, state.finger_velocities]),
            np.concatenate([state.efforts, np.zeros(2)]),
        )
        names = self._names[:ARM_DOF] if lost else self._names
        positions, velocities, efforts = (row[: len(names)] for row in rows)
        return joint_state_to_msg(names, positions, velocities, efforts, time)
