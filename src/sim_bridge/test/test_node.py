# ruff: noqa: E402
"""The simulator as other processes see it: one node, run for real, driven by a client of this process."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from ros_domain import next_domain

rclpy = pytest.importorskip("rclpy", exc_type=ImportError)
pytest.importorskip("cliport_interfaces", exc_type=ImportError)
pytest.importorskip("control_msgs", exc_type=ImportError)

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from franka_msgs.action import Grasp, Homing, Move
from franka_msgs.msg import GraspEpsilon
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Empty
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_interfaces.srv import GetScore, ResetTask
from sim_bridge.conversions import image_from_msg, time_from_msg

DOMAIN = next_domain()
ENVIRONMENT = os.environ | {"ROS_DOMAIN_ID": str(DOMAIN)}
COMMAND = [sys.executable, "-m", "sim_bridge.node"]
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
TASK = "put-blocks-in-bowls-seen-colors"


def start_node(*arguments):
    return subprocess.Popen(
        [*COMMAND, "--ros-args", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=ENVIRONMENT,
    )


class Client:
    """Subscribes to all that the simulator publishes and calls what it serves."""

    def __init__(self):
        rclpy.init(domain_id=DOMAIN, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        self.node = rclpy.create_node("tester")
        self.seen = {}
        self.joints = []
        self.clock = []
        best_effort = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        latched = QoSProfile(depth=1, durability=rclpy.qos.DurabilityPolicy.TRANSIENT_LOCAL)
        self.watch(Image, "/camera/color/image_raw", best_effort)
        self.watch(Image, "/camera/aligned_depth_to_color/image_raw", best_effort)
        self.watch(CameraInfo, "/camera/color/camera_info", best_effort)
        self.watch(TFMessage, "/tf_static", latched)
        self.node.create_subscription(Clock, "/clock", self.on_clock, 50)
        self.node.create_subscription(JointState, "/joint_states", self.on_joints, 50)
        self.heartbeat = self.node.create_publisher(Empty, "/panda_executor/heartbeat", 10)
        self.arm = ActionClient(self.node, FollowJointTrajectory, "/panda_arm_controller/follow_joint_trajectory")
        self.hand = ActionClient(self.node, GripperCommand, "/panda_gripper/gripper_action")
        self.reset = self.node.create_client(ResetTask, "/sim_bridge/reset")
        self.score = self.node.create_client(GetScore, "/sim_bridge/score")
        self.parameters = self.node.create_client(SetParameters, "/sim_bridge/set_parameters")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()

    def watch(self, kind, topic, qos):
        self.seen[topic] = []
        self.node.create_subscription(kind, topic, lambda msg: self.seen[topic].append((time.monotonic(), msg)), qos)

    def on_clock(self, msg):
        self.clock.append((time.monotonic(), time_from_msg(msg.clock)))

    def on_joints(self, msg):
        self.joints.append((time.monotonic(), msg))

    def positions(self):
        msg = self.joints[-1][1]
        return np.array([msg.position[list(msg.name).index(name)] for name in JOINTS])

    def until(self, condition, timeout=10.0):
        deadline = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < deadline, "timed out"
            time.sleep(0.005)

    def get(self, future, timeout=15.0):
        self.until(future.done, timeout)
        return future.result()

    def set(self, **switches):
        request = SetParameters.Request(
            parameters=[
                ParameterMsg(name=name, value=ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value))
                for name, value in switches.items()
            ]
        )
        assert all(result.successful for result in self.get(self.parameters.call_async(request)).results)

    def make_scene(self, seed=0, task=TASK, split="test", instruction=""):
        request = ResetTask.Request(task=task, split=split, seed=seed, instruction=instruction)
        answer = self.get(self.reset.call_async(request))
        moment = time.monotonic()
        self.until(lambda: self.joints[-1][0] > moment + 0.1)
        return answer

    def rest(self, after=0.3, seconds=1.0):
        """Joint 1 [rad] over `seconds` of simulated time that begin `after` s from now."""
        begin = time_from_msg(self.joints[-1][1].header.stamp) + after
        self.until(lambda: time_from_msg(self.joints[-1][1].header.stamp) > begin + seconds, 60.0)
        return [msg.position[0] for _, msg in self.joints if time_from_msg(msg.header.stamp) > begin]

    def send(self, goal, client=None):
        feedback = []
        handle = self.get((client or self.arm).send_goal_async(goal, lambda msg: feedback.append(msg.feedback)))
        return handle, feedback

    def result(self, handle):
        answer = self.get(handle.get_result_async())
        return answer.status, answer.result

    def close(self):
        self.executor.shutdown()
        self.thread.join(timeout=5.0)
        self.node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture(scope="module")
def log_path(tmp_path_factory):
    return tmp_path_factory.mktemp("sim") / "trajectories.jsonl"


@pytest.fixture(scope="module")
def client(log_path):
    process = start_node("-p", f"trajectory_log:={log_path}")
    client = Client()
    try:
        client.until(lambda: process.poll() is None and client.joints and client.clock, 30.0)
        client.until(lambda: all(client.seen.values()), 20.0)
        assert client.arm.wait_for_server(10.0)
        assert client.hand.wait_for_server(10.0)
        assert client.reset.wait_for_service(10.0)
        yield client
    finally:
        client.close()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=15.0)
    assert process.returncode == 0, output
    assert "Traceback" not in output, output


def swing(start, angle, seconds):
    """Joint 1 by `angle`, through the points of a smooth curve from rest to rest."""
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = JOINTS
    for t in np.linspace(0.0, seconds, 11):
        x = t / seconds
        point = JointTrajectoryPoint()
        shift = angle * np.array([x**3 * (10 - 15 * x + 6 * x * x), 30 * x**2 * (1 - x) ** 2 / seconds, 0.0])
        shift[2] = angle * 60 * x * (1 - x) * (1 - 2 * x) / seconds**2
        point.positions = (start + np.eye(7)[0] * shift[0]).tolist()
        point.velocities = (np.eye(7)[0] * shift[1]).tolist()
        point.accelerations = (np.eye(7)[0] * shift[2]).tolist()
        point.time_from_start = Duration(sec=int(t), nanosec=round((t % 1.0) * 1e9))
        goal.trajectory.points.append(point)
    return goal


def test_topics(client):
    begin, joints_start = client.clock[-1][1], len(client.joints)
    client.until(lambda: client.clock[-1][1] > begin + 2.0, 60.0)
    joints = client.joints[joints_start:]
    stamps = np.array([stamp for _, stamp in client.clock])
    assert (np.diff(stamps) > 0.0).all()
    # by simulated time, of which a busy machine makes less; a message may be lost
    assert 60 < np.count_nonzero(stamps > begin) < 400
    assert 40 < len(joints) < 400
    assert sorted(joints[-1][1].name) == sorted([*JOINTS, "panda_finger_joint1", "panda_finger_joint2"])
    assert client.positions() == pytest.approx([0, -0.785, 0, -2.356, 0, 1.571, 0.785], abs=0.01)
    transform = client.seen["/tf_static"][-1][1].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == (
        "panda_link0",
        "camera_color_optical_frame",
    )


def test_images(client):
    color = client.seen["/camera/color/image_raw"][-1][1]
    pixels = image_from_msg(color)
    assert pixels.shape == (540, 960, 3)
    assert pixels.std() > 10
    assert color.header.frame_id == "camera_color_optical_frame"
    depth = image_from_msg(client.seen["/camera/aligned_depth_to_color/image_raw"][-1][1])
    assert depth.shape == (540, 960)
    assert np.isnan(depth).any()
    assert 0.5 < np.nanmedian(depth) < 2.0
    info = client.seen["/camera/color/camera_info"][-1][1]
    assert (info.width, info.height, info.k[0], info.distortion_model) == (960, 540, 540.0, "plumb_bob")


def test_a_trajectory(client, log_path):
    client.make_scene()
    start = client.positions()
    handle, feedback = client.send(swing(start, 0.4, 1.5))
    assert handle.accepted
    status, result = client.result(handle)
    assert (status, result.error_code, result.error_string) == (GoalStatus.STATUS_SUCCEEDED, 0, "")
    assert client.positions()[0] == pytest.approx(start[0] + 0.4, abs=0.01)
    assert len(feedback) >= 8
    assert max(abs(message.error.positions[0]) for message in feedback) < 0.05
    logged = json.loads(log_path.read_text().splitlines()[-1])
    assert logged["joint_names"] == JOINTS
    assert np.array(logged["positions"]).shape == np.array(logged["velocities"]).shape == (11, 7)


def test_cancel_holds_within_three_tenths_of_a_second(client):
    client.make_scene()
    handle, _ = client.send(swing(client.positions(), 1.0, 1.6))
    client.until(lambda: client.joints[-1][1].velocity[0] > 0.5, 60.0)
    cancel = handle.cancel_goal_async()
    status, _ = client.result(handle)  # by then the controller has heard it
    assert client.get(cancel).return_code == 0
    assert status == GoalStatus.STATUS_CANCELED
    held = client.rest(after=0.3)
    assert np.ptp(held) < 2e-3
    assert held[-1] < 0.9


def test_a_new_goal_aborts_the_old(client):
    client.make_scene()
    start = client.positions()
    first, _ = client.send(swing(start, 0.5, 3.0))
    time.sleep(0.2)
    goal = FollowJointTrajectory.Goal()
    goal.trajectory.joint_names = JOINTS
    rest = [0.0] * 7
    target = (start - 0.2 * np.eye(7)[0]).tolist()
    goal.trajectory.points = [
        JointTrajectoryPoint(positions=target, velocities=rest, accelerations=rest, time_from_start=Duration(sec=1))
    ]
    second, _ = client.send(goal)
    status, result = client.result(first)
    assert status == GoalStatus.STATUS_ABORTED
    assert "preempted" in result.error_string
    assert client.result(second)[0] == GoalStatus.STATUS_SUCCEEDED


def test_bad_goals(client):
    client.make_scene()
    goal = swing(client.positions(), 0.1, 1.0)
    goal.trajectory.joint_names = [*JOINTS[:6], "elbow"]
    assert not client.send(goal)[0].accepted
    jump = swing(client.positions() + 0.2, 0.1, 1.0)
    handle, _ = client.send(jump)
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "reflex" in result.error_string
    wide = GripperCommand.Goal()
    wide.command.position = 0.08
    assert not client.send(wide, client.hand)[0].accepted


def test_the_hand_takes_half_and_reports_all_of_the_width(client):
    client.make_scene()
    for half, width in ((0.01, 0.02), (0.04, 0.08)):
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = half, 20.0
        status, result = client.result(client.send(goal, client.hand)[0])
        assert status == GoalStatus.STATUS_SUCCEEDED
        assert result.position == pytest.approx(width, abs=2e-3)
        assert (result.reached_goal, result.stalled) == (True, False)


def test_the_hand_does_what_franka_msgs_ask_for(client):
    client.make_scene()
    goals = (
        (Move, "move", Move.Goal(width=0.02, speed=0.1)),
        (Grasp, "grasp", Grasp.Goal(width=0.0, speed=0.1, force=20.0, epsilon=GraspEpsilon(inner=0.08, outer=0.08))),
        (Homing, "homing", Homing.Goal()),
    )
    for kind, name, goal in goals:
        server = ActionClient(client.node, kind, f"/panda_gripper/{name}")
        status, result = client.result(client.send(goal, server)[0])
        assert (status, result.success, result.error) == (GoalStatus.STATUS_SUCCEEDED, True, ""), name
    stop = client.node.create_client(Trigger, "/panda_gripper/stop")
    assert stop.wait_for_service(10.0)
    future = stop.call_async(Trigger.Request())
    client.until(future.done, 30.0)
    assert future.result().success


def test_a_lost_heartbeat_holds_the_arm(client):
    client.make_scene()
    beating = threading.Event()
    beating.set()

    def beat():
        while beating.is_set():
            client.heartbeat.publish(Empty())
            time.sleep(0.05)

    beater = threading.Thread(target=beat, daemon=True)
    beater.start()
    time.sleep(0.5)
    handle, _ = client.send(swing(client.positions(), 1.0, 2.5))
    client.until(lambda: client.positions()[0] > 0.1, 60.0)
    beating.clear()
    beater.join()
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "heartbeat lost" in result.error_string
    held = client.rest()
    assert np.ptp(held) < 2e-3
    assert held[-1] < 0.95  # it did not go on to its end


def test_faults(client):
    client.make_scene()
    depth_topic = "/camera/aligned_depth_to_color/image_raw"
    client.set(freeze_camera=True)
    time.sleep(0.4)
    frames = len(client.seen[depth_topic])
    time.sleep(0.8)
    assert len(client.seen[depth_topic]) == frames
    client.set(freeze_camera=False, depth_all_nan=True)
    client.until(lambda: np.isnan(image_from_msg(client.seen[depth_topic][-1][1])).all(), 5.0)
    client.set(depth_all_nan=False, abort_next_trajectory=True)
    start = client.positions()
    status, result = client.result(client.send(swing(start, 0.6, 2.0))[0])
    assert status == GoalStatus.STATUS_ABORTED
    assert "injected" in result.error_string
    time.sleep(0.4)
    status, _ = client.result(client.send(swing(client.positions(), 0.2, 1.0))[0])
    assert status == GoalStatus.STATUS_SUCCEEDED
    client.until(lambda: not np.isnan(image_from_msg(client.seen[depth_topic][-1][1])).all(), 5.0)


def test_reset_and_score(client):
    answer = client.make_scene(seed=3)
    assert answer.success, answer.message
    assert "bowl" in answer.instruction
    assert answer.max_steps > 0
    score = client.get(client.score.call_async(GetScore.Request()))
    assert (score.success, score.task, score.split, score.seed) == (True, TASK, "test", 3)
    assert (score.score, score.done) == (0.0, False)
    bad = client.make_scene(task="put-blocks-in-bowls-seen-colours")
    assert not bad.success
    assert TASK in bad.message
    assert "\n" not in bad.message
    assert not client.make_scene(seed=-1).success
    again = client.get(client.score.call_async(GetScore.Request()))
    assert again.seed == 3


def test_reset_ends_a_running_motion(client):
    client.make_scene()
    handle, _ = client.send(swing(client.positions(), 0.8, 2.0))
    time.sleep(0.6)
    client.make_scene()
    status, result = client.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert "reset" in result.error_string
    assert client.positions()[0] == pytest.approx(0.0, abs=0.01)
