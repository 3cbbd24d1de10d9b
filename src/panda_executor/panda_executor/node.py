"""The node `executor`: PickPlace and MoveHand goals in; trajectories and gripper commands out."""

from __future__ import annotations

import time
from functools import partial

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, JointState, PointCloud2
from std_msgs.msg import Empty, String
from tf2_msgs.msg import TFMessage

from cliport_core import topics
from cliport_core.heartbeat import Heartbeat
from cliport_core.messages import pose_from_transform_msg, stamp_from_msg
from cliport_core.raw_header import header_of_raw
from cliport_core.ros_camera_complaints import pass_complaints_on
from panda_executor import conversions
from panda_executor.approvals import Approvals
from panda_executor.camera_place import CameraPlace
from panda_executor.cloud_cache import CloudCache
from panda_executor.gate import Gate
from panda_executor.goal_session import GoalSession
from panda_executor.guard_watch import GUARD_STATUS, GuardWatch
from panda_executor.health import AgeLimits, assess
from panda_executor.joint_tracker import JointTracker
from panda_executor.model import PandaModel
from panda_executor.node_controllers import Controllers
from panda_executor.node_description import described
from panda_executor.node_goals import GoalServers
from panda_executor.node_parameters import NodeParameters, read_parameters
from panda_executor.node_preview import PlanPreviews
from panda_executor.node_services import PersonServices
from panda_executor.owned_runs import Watchers
from panda_executor.owner_watch import OwnerWatch
from panda_executor.runner import PickPlaceRunner
from panda_executor.surroundings import Surroundings
from panda_executor.transfer import TransferPlanner

_LAST_WORDS = 0.2  # for the ended goal's result to reach its client [s]
_TURN = 0.05  # between two signs that callbacks are delivered [s]


class ExecutorNode(Node):
    """The node: it maps requests; their meaning is the runner's matter.

    Raises:
        ExecutorError, CoreError: when a parameter cannot be used.
    """

    def __init__(self) -> None:
        super().__init__("panda_executor")
        parameters = self._settings = read_parameters(self)
        robot = parameters.robot
        ages = parameters.max_joint_age, parameters.max_ahead
        self._limits = AgeLimits(parameters.max_joint_age, parameters.max_cloud_age, parameters.max_ahead)
        self._joints = JointTracker(robot.arm_joints, robot.finger_joints, *ages)
        self.gate = Gate(lambda: self._joints.is_still(self._now_ns()))
        self._clouds = CloudCache(parameters.max_cloud_age, parameters.cloud_behind, parameters.max_ahead)
        self._camera = CameraPlace(robot.base_frame, parameters.cameras)
        self._calls = ReentrantCallbackGroup()
        self._controllers = Controllers(self, parameters, self._joints, self.gate.note_motion, self._calls)
        self._runner = self._make_runner(parameters)
        self._owners = OwnerWatch(time.monotonic, parameters.owner_silence)
        self._guard = GuardWatch(time.monotonic, parameters.guard_silence)
        previews = PlanPreviews(self, self._runner.planner.model, robot.base_frame)
        self._approvals = Approvals(parameters.approval_time, show=previews.show)
        self._session = GoalSession(
            self._runner, self._clouds, self._camera, parameters, self.gate, self._now_ns,
            Watchers(self._owners, self._guard), self._approvals,
        )  # fmt: skip
        self._subscribe()
        self._offer()

    def _make_runner(self, parameters: NodeParameters) -> PickPlaceRunner:
        robot = parameters.robot
        model = PandaModel(robot, parameters.self_clearance, described(self, robot, parameters.robot_description))
        planner = TransferPlanner(model, parameters.config)
        return PickPlaceRunner(model, planner, self._controllers.arm, self._controllers.gripper)

    def _subscribe(self) -> None:
        data, best_effort = MutuallyExclusiveCallbackGroup(), qos_profile_sensor_data
        # Reliable, unlike for a camera's topics: a message of 16 MB rarely arrives whole by best effort.
        self.create_subscription(
            PointCloud2, topics.POINTS, self._clouds.put, QoSProfile(depth=1), raw=True,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )  # fmt: skip
        self.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, best_effort, callback_group=data)
        self.create_subscription(DiagnosticArray, topics.DIAGNOSTICS, self._on_report, 20, callback_group=data)
        self.create_subscription(String, topics.OWNER_HEARTBEAT, self._on_owner, 20, callback_group=data)
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(TFMessage, topics.TF_STATIC, self._on_transforms, latched, callback_group=data)
        for number in range(1, self._settings.cameras + 1):
            self.create_subscription(
                CameraInfo, topics.of_camera(topics.CAMERA_INFO, number), partial(self._on_camera_info, number),
                best_effort, raw=True, callback_group=data,
            )  # fmt: skip

    def _offer(self) -> None:
        """Offer services, diagnostics, the heartbeat and, last, the actions."""
        services = ReentrantCallbackGroup()
        surroundings = Surroundings(
            self._runner.planner, self._clouds, self._camera, self._settings.robot.base_frame, self._now_ns
        )
        PersonServices(self, self.gate, self._runner, self._approvals, self._controllers.stop, surroundings, services)
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0, self._report, callback_group=services, clock=steady)
        pulse = self._controllers.pulse
        self.create_timer(_TURN, pulse.turn, callback_group=services, clock=steady)
        beats = self.create_publisher(Empty, topics.HEARTBEAT, 10)
        self._heartbeat = Heartbeat(lambda: beats.publish(Empty()), is_alive=pulse.is_alive)
        self._goals = GoalServers(self, self._session, self.gate, self._calls)

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _on_joints(self, message: JointState) -> None:
        self._joints.update(message.name, message.position, stamp_from_msg(message.header.stamp))

    def _on_report(self, message: DiagnosticArray) -> None:
        pass_complaints_on(self._clouds.complain, message)
        if any(status.name == GUARD_STATUS for status in message.status):
            self._guard.on_report()

    def _on_owner(self, message: String) -> None:
        self._owners.on_beat(str(message.data))

    def _on_transforms(self, message: TFMessage) -> None:
        for link in message.transforms:
            try:
                pose = pose_from_transform_msg(link.transform)
            except ValueError as error:
                self.get_logger().warning(f"transform of '{link.child_frame_id}' ignored: {error}")
                continue
            self._camera.put(link.header.frame_id, link.child_frame_id, pose)

    def _on_camera_info(self, number: int, raw: bytes) -> None:
        self._camera.see(header_of_raw(raw)[1], number)

    def _report(self) -> None:
        now_ns = self._now_ns()
        report = assess(
            self._joints.age(now_ns), self._clouds.age(now_ns), self._controllers.arm_ready,
            self._controllers.gripper_ready, self.gate.refusal(), self.gate.busy, self._limits,
            self._runner.held_width(),
        )  # fmt: skip
        self._diagnostics.publish(conversions.diagnostics_to_msg(report, now_ns))

    def close(self) -> None:
        """Stop what runs, wait until the arm has been told, and end the heartbeat."""
        self.gate.close()
        deadline = time.monotonic() + 3.0
        while self.gate.busy and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(_LAST_WORDS)
        self._heartbeat.stop()
