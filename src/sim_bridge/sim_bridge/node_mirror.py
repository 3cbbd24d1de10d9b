"""The subscription through which a mirrored arm is heard."""

from __future__ import annotations

import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from sensor_msgs.msg import JointState

from panda_model import ARM_DOF, ArmModel
from sim_bridge.conversions import time_from_msg
from sim_bridge.mirror import Mirror, Reported


def hear(node: Node, topic: str, arm: ArmModel, mirror: Mirror) -> None:
    """Report each message on `topic` that has all of the arm's joints; one without fingers says nothing of the hand."""

    def take(message: JointState) -> None:
        try:
            order = [message.name.index(joint) for joint in arm.joints]
        except ValueError:
            return
        positions = np.array(message.position)[order]
        velocities = np.array(message.velocity)[order[:ARM_DOF]]
        width = float(positions[ARM_DOF:].sum())
        mirror.report(Reported(time_from_msg(message.header.stamp), positions[:ARM_DOF], velocities, width))

    node.create_subscription(JointState, topic, take, 50, callback_group=MutuallyExclusiveCallbackGroup())
