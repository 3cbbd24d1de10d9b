"""A client of the simulator's node in this process: all that it publishes, and calls of what it serves."""

import threading
import time

import numpy as np
import rclpy
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Empty
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from cliport_interfaces.srv import GetScore, ResetTask
from sim_bridge.conversions import time_from_msg

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
TASK = "put-blocks-in-bowls-seen-colors"


class Client:
    """Subscribes to all that the simulator publishes and calls what it serves."""

    def __init__(self, domain):
        rclpy.init(domain_id=domain, signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
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
