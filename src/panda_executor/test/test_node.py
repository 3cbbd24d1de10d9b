"""The executor as a process, without the arm's action servers."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TransformStamped
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from ros_clouds import raw_cloud
from ros_domain import next_domain
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_srvs.srv import Trigger
from synthetic_clouds import CAMERA
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.messages import goal_to_msg, pose_to_transform_msg, result_from_msg, stamp_to_msg
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose, Pose
from cliport_interfaces.action import PickPlace
from panda_model import load_preset

READY_POSITIONS = load_preset().ready

DOMAIN = next_domain()
ENVIRONMENT = os.environ | {"ROS_DOMAIN_ID": str(DOMAIN)}
PICK, PLACE = PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3)
GOAL = ActionGoal(PickPlaceAction(PICK, PLACE))


MAIN = "import sys; from panda_executor.main import main; "


def start_executor(*parameters: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", f"{MAIN}raise SystemExit(main())", "--ros-args"]
    parameters = ("auto_approve:=true", *parameters)
    command += [part for parameter in parameters for part in ("-p", parameter)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT)


def test_bad_parameters_end_in_one_line() -> None:
    """One process tries them one after the other: to start one takes seconds."""
    bad = {
        "robot_description:=/nowhere/arm.urdf": "cannot read the robot description /nowhere/arm.urdf",
        "grip_force:=soft": "grip_force",
    }
    start = "main(['--ros-args', '-p', 'auto_approve:=true', '-p', word])"
    each = f"sum(2**i * {start} for i, word in enumerate(sys.argv[1:]))"
    command = [sys.executable, "-c", f"{MAIN}raise SystemExit({each})", *bad]
    run = subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, timeout=90.0)
    assert run.returncode == 0b11
    for line, words in zip(run.stderr.splitlines(), bad.values(), strict=True):
        assert line.startswith("error: ")
        assert words in line


class Graph:
    """A node beside the executor."""

    def __init__(self) -> None:
        rclpy.init(domain_id=DOMAIN)
        self.node = Node("tester")
        self.executor = MultiThreadedExecutor(num_threads=3)
        self.executor.add_node(self.node)
        self.client = ActionClient(self.node, PickPlace, "/panda_executor/pick_place")
        self.clouds = self.node.create_publisher(PointCloud2, "/cliport/points", 1)
        self.joints = self.node.create_publisher(JointState, "/joint_states", 5)
        self.infos = self.node.create_publisher(CameraInfo, "/camera/color/camera_info", 5)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.previews: dict[str, Any] = {}
        for name, kind in (("trajectory", JointTrajectory), ("markers", MarkerArray), ("picture", Image)):
            take = partial(self.previews.__setitem__, name)
            self.node.create_subscription(kind, f"/panda_executor/preview/{name}", take, latched)
        self.transforms = self.node.create_publisher(TFMessage, "/tf_static", latched)

    def until(self, done: Callable[[], bool], timeout_s: float = 15.0) -> bool:
        end = time.monotonic() + timeout_s
        while not done() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return done()

    def wait(self, future: Future) -> Any:
        assert self.until(future.done)
        return future.result()

    def ask(self, goal: ActionGoal, frame: str = "panda_link0") -> ActionResult | None:
        """None when the goal is rejected."""
        handle = self.wait(self.client.send_goal_async(goal_to_msg(goal, frame)))
        return result_from_msg(self.wait(handle.get_result_async()).result) if handle.accepted else None

    def call(self, service: str) -> bool:
        client = self.node.create_client(Trigger, service)
        assert self.until(client.service_is_ready)
        return bool(self.wait(client.call_async(Trigger.Request())).success)

    def place_camera(self) -> None:
        """Say where the camera stands, as its calibration does."""
        link = TransformStamped(child_frame_id="lens")
        link.header.frame_id = "panda_link0"
        link.transform = pose_to_transform_msg(Pose(np.eye(3), CAMERA))
        self.transforms.publish(TFMessage(transforms=[link]))

    def publish(self, cloud: np.ndarray) -> None:
        """One cloud, and joint states of an arm at its ready pose that never moves."""
        now_ns = self.node.get_clock().now().nanoseconds
        self.clouds.publish(raw_cloud(cloud, now_ns))
        info = CameraInfo()
        info.header.frame_id = "lens"
        self.infos.publish(info)
        names = [*(f"panda_joint{i}" for i in range(1, 8)), "panda_finger_joint1", "panda_finger_joint2"]
        message = JointState(name=names, position=[*READY_POSITIONS.tolist(), 0.04, 0.04])
        message.header.stamp = stamp_to_msg(now_ns)
        self.joints.publish(message)

    def close(self) -> None:
        self.executor.shutdown(timeout_sec=1.0)
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def graph() -> Iterator[Graph]:
    graph = Graph()
    yield graph
    graph.close()


@pytest.fixture
def process() -> Iterator[subprocess.Popen[str]]:
    process = start_executor(
        "require_owner:=false", "guard_silence:=0.0", "cloud_wait:=0.3", "max_joint_age:=60.0", "max_cloud_age:=60.0"
    )
    yield process
    if process.poll() is None:
        process.kill()
    process.communicate(timeout=10.0)


def test_goals_without_an_arm(graph: Graph, process: subprocess.Popen[str], table_cloud: np.ndarray) -> None:
    assert graph.until(graph.client.server_is_ready, 60.0)  # a busy machine is long in starting it

    def ends(goal: ActionGoal, outcome: Outcome, words: str) -> None:
        result = graph.ask(goal)
        assert result is not None
        assert result.outcome is outcome, result.message
        assert words in result.message
        assert "\n" not in result.message

    ends(ActionGoal(PickPlaceAction(PlanarPose(0.9, 0.1, 0.0), PLACE)), Outcome.REJECTED, "is outside the workspace")
    ends(GOAL, Outcome.REJECTED, "no point cloud has arrived")
    elsewhere = graph.ask(GOAL, frame="map")
    assert elsewhere is not None
    assert elsewhere.outcome is Outcome.REJECTED and "must be in frame 'panda_link0'" in elsewhere.message
    streams = (graph.clouds, graph.joints, graph.infos, graph.transforms)
    assert graph.until(lambda: all(publisher.get_subscription_count() for publisher in streams))
    graph.publish(table_cloud)
    time.sleep(0.3)
    ends(replace(GOAL, plan_only=True), Outcome.REJECTED, "no transform from 'lens' to 'panda_link0'")
    graph.place_camera()
    graph.publish(table_cloud)
    time.sleep(0.3)
    ends(replace(GOAL, plan_only=True), Outcome.PLANNED, "planned 7 motions")
    assert graph.until(lambda: set(graph.previews) == {"trajectory", "markers", "picture"})
    named = graph.previews["trajectory"].header.frame_id
    assert named.startswith("plan ") and named == graph.previews["markers"].markers[-1].text
    graph.publish(table_cloud)
    time.sleep(0.3)
    ends(GOAL, Outcome.EXECUTION_FAILED, "no action server at /panda_arm_controller")
    assert graph.call("/panda_executor/stop")
    assert graph.ask(GOAL) is None
    assert graph.call("/panda_executor/resume")
    ends(ActionGoal(PickPlaceAction(PICK, PlanarPose(0.5, 0.9, 0.0))), Outcome.REJECTED, "is outside the workspace")
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=10.0)
    assert process.returncode == 0
    assert "Traceback" not in errors
