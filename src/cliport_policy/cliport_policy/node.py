"""The node `server`: an instruction in, pick and place goals for the executor out, step by step."""

from __future__ import annotations

import time
from dataclasses import fields
from functools import partial

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from cliport_core import topics
from cliport_core.action import ActionGoal
from cliport_core.errors import CoreError
from cliport_core.messages import heightmap_from_msg, stamp_from_msg, status_to_msg
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.ros_camera_complaints import hear_camera_complaints
from cliport_core.ros_running import run_node
from cliport_core.ros_spin_queue import SpinQueue
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import PolicyStatus
from cliport_interfaces.srv import LoadPolicy
from cliport_policy.errors import PolicyError
from cliport_policy.node_services import PersonServices
from cliport_policy.policy import Policy, load_policy
from cliport_policy.server.executor_link import ExecutorLink
from cliport_policy.server.inference_worker import InferenceAnswer, InferenceWorker, use_threads
from cliport_policy.server.logic import PolicyServer
from cliport_policy.server.types import Moment, ServerConfig
from cliport_policy.server.wording import one_line
from cliport_policy.views import ProposalViews
from panda_model.ros_parameters import declare_base_frame, declare_robot

TICK_S = 0.05


class PolicyServerNode(Node):
    """The node: it feeds a `PolicyServer` with what ROS brings, and does what it asks for (as its `ServerEffects`).

    Raises:
        PolicyError: when the checkpoint or a parameter is unusable.
    """

    def __init__(self) -> None:
        super().__init__("cliport_policy")
        base_frame = declare_base_frame(self, declare_robot(self))
        settings = {f.name: self.declare_parameter(f.name, f.default).value for f in fields(ServerConfig)}
        self._config = ServerConfig(**settings)
        self._compiled = bool(self.declare_parameter("compile", False).value)
        use_threads(int(self.declare_parameter("threads", 0).value))
        self._policy = load_policy(str(self.declare_parameter("checkpoint", "default").value), compiled=self._compiled)
        self._queue = SpinQueue(self)
        self._worker = InferenceWorker(self._policy, self._hand_over)
        self._worker.warm_up()
        self._last_answer: InferenceAnswer | None = None

        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._status = self.create_publisher(PolicyStatus, topics.STATUS, latched)
        self._views = ProposalViews(self, base_frame)
        self._executor_link = ExecutorLink(self, base_frame, self._now)
        self._server = PolicyServer(self._config, self, self._check_instruction, self._executor_link)
        self._executor_link.attach(self._server)
        self.create_subscription(String, topics.INSTRUCTION, self._on_instruction, 10)
        self.create_subscription(HeightmapMsg, topics.HEIGHTMAP, self._on_heightmap, 2)
        hear_camera_complaints(self, self._server.on_complaint)
        PersonServices(self, self._server, self._executor_link, self._now)
        self.create_service(LoadPolicy, topics.LOAD_POLICY, self._on_load)
        # wall time: nothing may hang when simulated time stands still
        self.create_timer(TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._server.announce()

    def close(self) -> None:
        """Stop the inference thread."""
        self._worker.close()

    def _tick(self) -> None:
        self._queue.run()
        self._server.tick(self._now())
        self._executor_link.beat()

    def _now(self) -> Moment:
        return Moment(time.monotonic(), self.get_clock().now().nanoseconds)

    def _on_instruction(self, message: String) -> None:
        self._server.on_instruction(message.data, self._now())

    def _check_instruction(self, instruction: str) -> None:
        self._policy.check_instruction(instruction)

    def _on_load(self, request: LoadPolicy.Request, response: LoadPolicy.Response) -> LoadPolicy.Response:
        checkpoint = str(request.checkpoint)
        response.success, response.message = self._server.hold(f"loading the policy {checkpoint}")
        if response.success:
            self._worker.run(partial(self._load, checkpoint))
        return response

    def _load(self, checkpoint: str) -> None:
        """Load a policy, in the worker's thread."""
        try:
            policy = load_policy(checkpoint, compiled=self._compiled)
            policy.warm_up()
        except Exception as error:  # whatever it is, the server must not wait for ever
            words = str(error) if isinstance(error, PolicyError) else f"{type(error).__name__}: {error}"
            self._queue.post(partial(self._server.release, one_line(f"{words}; the present policy stays")))
            return
        self._queue.post(partial(self._take, checkpoint, policy))

    def _take(self, checkpoint: str, policy: Policy) -> None:
        self._policy = policy
        self._worker.use(policy)
        self._server.release(f"the policy {checkpoint} is loaded")

    def _on_heightmap(self, message: HeightmapMsg) -> None:
        self._server.on_observation(stamp_from_msg(message.header.stamp), message, self._now())

    def _hand_over(self, answer: InferenceAnswer) -> None:
        """Pass an answer from the worker's thread to this node's."""
        self._queue.post(partial(self._on_answer, answer))

    def _on_answer(self, answer: InferenceAnswer) -> None:
        self._last_answer = answer
        if answer.inference is None:
            self._server.on_inference_failed(answer.token, answer.error)
        else:
            self._server.on_proposal(answer.token, answer.inference, self._now())

    def publish_status(self, status: ServerStatus) -> None:
        """Publish a status, and log it."""
        stamp_ns = self.get_clock().now().nanoseconds
        self._status.publish(status_to_msg(status, self._config.max_steps, stamp_ns))
        line = f"{status.state.name}: {status.message}"
        if status.state == PolicyState.FAILED:
            self.get_logger().error(line)
        else:
            self.get_logger().info(line)

    def publish_proposal(self, goal: ActionGoal) -> None:
        """Publish the poses of a goal, and later, from the worker's thread, its maps."""
        self._views.publish_poses(goal)
        answer = self._last_answer
        if answer and answer.heightmap and answer.inference:
            self._worker.run(partial(self._views.publish_maps, answer.heightmap, answer.inference))

    def start_inference(self, token: int, observation: HeightmapMsg, instruction: str) -> None:
        """Start an inference in the worker's thread."""
        self._worker.start(token, partial(heightmap_from_msg, observation), instruction)


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit status."""
    return run_node(lambda _: PolicyServerNode(), (PolicyError, CoreError), args, PolicyServerNode.close)
