"""The hand's frame on /tf, from joint states in any order."""

from __future__ import annotations

import time

import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from ros_domain import next_domain
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from cliport_core import messages, topics
from panda_executor.model import PandaModel
from panda_executor.node_hand_frame import HandFrameNode, main
from panda_model import load_preset


def test_the_tcp_is_where_the_joints_put_it() -> None:
    arm = load_preset()
    rclpy.init(domain_id=next_domain())
    node, someone = HandFrameNode(), rclpy.create_node("someone")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.add_node(someone)
    states = someone.create_publisher(JointState, topics.JOINT_STATES, 10)
    seen: list[TFMessage] = []
    someone.create_subscription(TFMessage, topics.TF, seen.append, 10)
    names = [*reversed(arm.joints), "wheel"]
    positions = dict(zip(arm.joints, [*arm.ready, 0.02, 0.02])) | {"wheel": 3.0}
    end = time.monotonic() + 15.0
    while not seen and time.monotonic() < end:
        states.publish(JointState(name=["wheel"], position=[1.0]))
        message = JointState(name=names, position=[float(positions[name]) for name in names])
        message.header.stamp = messages.stamp_to_msg(7_000_000_000)
        states.publish(message)
        executor.spin_once(timeout_sec=0.05)
    (link,) = seen[0].transforms
    assert (link.header.frame_id, link.child_frame_id) == (arm.base_frame, arm.tcp_frame)
    assert messages.stamp_from_msg(link.header.stamp) == 7_000_000_000
    wanted = PandaModel(arm).tcp_pose(np.array(arm.ready))
    assert messages.pose_from_transform_msg(link.transform).is_close(wanted, 1e-6)
    executor.shutdown()
    node.destroy_node()
    someone.destroy_node()
    rclpy.try_shutdown()


def test_the_hands_own_messages_are_no_news_of_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = load_preset()
    rclpy.init(domain_id=next_domain())
    node = HandFrameNode()
    sent: list[int] = []

    def publish(message: TFMessage) -> None:
        sent.append(messages.stamp_from_msg(message.transforms[0].header.stamp))

    monkeypatch.setattr(node._transforms, "publish", publish)

    def hear(names: tuple[str, ...], positions: list[float], stamp_ns: int) -> None:
        message = JointState(name=list(names), position=positions)
        message.header.stamp = messages.stamp_to_msg(stamp_ns)
        node._on_joints(message)

    hear(arm.arm_joints, [float(v) for v in arm.ready], 7_000_000_000)
    hear(arm.finger_joints, [0.02, 0.02], 7_300_000_000)
    assert sent == [7_000_000_000]
    hear(arm.arm_joints, [float(v) for v in arm.ready], 7_400_000_000)
    assert sent == [7_000_000_000, 7_400_000_000]
    node.destroy_node()
    rclpy.try_shutdown()


def test_an_unknown_robot_ends_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--ros-args", "-p", "robot:=puma"]) == 1
    assert capsys.readouterr().err.startswith("error: unknown robot 'puma'")
