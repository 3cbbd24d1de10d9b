"""The subscription through which a mirrored arm is heard."""

from __future__ import annotations

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from sensor_msgs.msg import JointState

from panda_model import ArmModel
from sim_bridge.conversions import time_from_msg
from sim_bridge.mirror import Mirror, Reported

_SILENCE = 5.0  # before the first report, after which somebody is told [s]


def hear(node: Node, topic: str, arm: ArmModel, mirror: Mirror) -> None:
    """Report each message on `topic` that has the arm's joints; say so while there is none."""

    def take(message: JointState) -> None:
        reported = reported_from_msg(message, arm)
        if reported is not None:
            mirror.report(reported)

    def complain() -> None:
        if mirror.newest is None:
            node.get_logger().warning(
                f"no positions and velocities of {', '.join(arm.arm_joints)} on {topic} yet: is the other arm's driver "
                "running, and is that its topic? The simulation waits for them"
            )

    node.create_subscription(JointState, topic, take, 50, callback_group=MutuallyExclusiveCallbackGroup())
    node.create_timer(_SILENCE, complain, clock=Clock(clock_type=ClockType.STEADY_TIME))


def reported_from_msg(message: JointState, arm: ArmModel) -> Reported | None:
    """Return what a message says of the arm; None where a joint, or its position or velocity, is missing."""
    at = {name: i for i, name in enumerate(message.name)}
    if not set(arm.arm_joints) <= set(at) or not len(at) == len(message.position) == len(message.velocity):
        return None
    order = [at[joint] for joint in arm.arm_joints]
    fingers = [message.position[at[joint]] for joint in arm.finger_joints if joint in at]
    width = float(sum(fingers)) if len(fingers) == len(arm.finger_joints) else None
    positions, velocities = np.array(message.position), np.array(message.velocity)
    return Reported(time_from_msg(message.header.stamp), positions[order], velocities[order], width)
