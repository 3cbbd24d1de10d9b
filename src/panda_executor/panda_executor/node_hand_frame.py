"""The node `hand_frame`: base → tcp on /tf from the joint states, where no robot_state_publisher runs."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from cliport_core import topics
from cliport_core.errors import CoreError
from cliport_core.messages import pose_to_transform_msg, stamp_from_msg, stamp_to_msg
from cliport_core.ros_running import run_node
from panda_executor.errors import ExecutorError, PortError
from panda_executor.joint_tracker import JointTracker
from panda_executor.model import PandaModel
from panda_model.description import load_description
from panda_model.ros_parameters import declare_base_frame, declare_robot


class HandFrameNode(Node):
    """Publishes where the tcp is, with the stamp of the joint states that say so.

    Raises:
        ExecutorError, CoreError: when a parameter cannot be used.
    """

    def __init__(self, **options: Any) -> None:
        """Begin to listen. options: of rclpy's Node."""
        super().__init__("hand_frame", **options)
        robot = declare_robot(self)
        self._base_frame, self._tcp_frame = declare_base_frame(self, robot), robot.tcp_frame
        given = str(self.declare_parameter("robot_description", "").value)
        self._model = PandaModel(robot, description=load_description(robot, given))
        self._joints = JointTracker(robot.arm_joints, robot.finger_joints)
        self._published_ns: int | None = None
        self._transforms = self.create_publisher(TFMessage, topics.TF, 10)
        self.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, qos_profile_sensor_data)

    def _on_joints(self, message: JointState) -> None:
        self._joints.update(message.name, message.position, stamp_from_msg(message.header.stamp))
        stamp_ns = self._joints.arm_stamp_ns()
        if stamp_ns is None or stamp_ns == self._published_ns:
            return  # a message of other joints
        try:
            positions = self._joints.arm_positions(stamp_ns)
        except PortError:
            return  # of joints that were stamped far apart
        self._published_ns = stamp_ns
        tcp_in_base = self._model.tcp_pose(positions)
        link = TransformStamped(child_frame_id=self._tcp_frame, transform=pose_to_transform_msg(tcp_in_base))
        link.header.frame_id = self._base_frame
        link.header.stamp = stamp_to_msg(stamp_ns)
        self._transforms.publish(TFMessage(transforms=[link]))


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run_node(lambda _: HandFrameNode(), (ExecutorError, CoreError), args)
