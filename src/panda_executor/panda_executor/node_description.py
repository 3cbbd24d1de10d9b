"""The robot's description as a driver publishes it."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.wait_for_message import wait_for_message
from std_msgs.msg import String

from panda_executor.errors import ExecutorError
from panda_model import ArmModel
from panda_model.description import RobotDescription, load_description

_TOPIC = "topic:"
_PATIENCE = 10.0  # for a latched description to arrive, wall clock [s]


def described(node: Node, robot: ArmModel, given: str) -> RobotDescription:
    """Return the description that the parameter robot_description means for an arm; warn where it is a stand-in.

    Raises:
        ExecutorError, CoreError: when there is none.
    """
    description = load_description(robot, description_text(node, given))
    if description.notice:
        node.get_logger().warning(description.notice)
    return description


def description_text(node: Node, given: str) -> str:
    """Return the URDF that the parameter robot_description means: "topic:NAME" is heard, all else is as it is given.

    Raises:
        ExecutorError: when nobody publishes it.
    """
    if not given.startswith(_TOPIC):
        return given
    name = given.removeprefix(_TOPIC)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    found, message = wait_for_message(String, node, name, qos_profile=latched, time_to_wait=_PATIENCE)
    if not found or not message.data.lstrip().startswith("<"):
        raise ExecutorError(f"no robot description on {name} for {_PATIENCE:g} s: is the arm's driver running?")
    return str(message.data)
