"""A graph around the policy server's node: a camera, an executor, a person, and a policy that knows."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.action import CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.messages import heightmap_to_msg
from cliport_core.pose import PlanarPose
from cliport_core.ros_action_server import ThreadedActionServer
from cliport_core.ros_late_service import Give, LateService
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import PolicyStatus
from cliport_interfaces.srv import ApprovePlan, LoadPolicy
from cliport_policy import node as node_module
from cliport_policy.errors import InstructionError
from cliport_policy.inference import AffordanceMaps, Inference

WORKSPACE = WorkspaceSpec()
PICK, PLACE = PlanarPose(0.4, 0.1, 0.3), PlanarPose(0.5, -0.2, 1.0)


class FakePolicy:
    """Wants `steps` actions, then sees the goal reached."""

    workspace = WORKSPACE

    def __init__(self, steps: int = 2, primitive: Primitive = Primitive.PICK_PLACE) -> None:
        self.left, self.primitive = steps, primitive
        self.error: Exception | None = None

    def check_instruction(self, text: str) -> None:
        if "block" not in text:
            raise InstructionError("the instruction is not understood")

    def warm_up(self) -> None:
        pass

    def infer(self, observation: Heightmap, instruction: str, with_maps: bool = False) -> Inference:
        if self.error:
            raise self.error
        cells = np.full(WORKSPACE.shape, 1.0 / (WORKSPACE.rows * WORKSPACE.cols), np.float32)
        done = 1.0 if self.left == 0 else 0.0
        self.left = max(0, self.left - 1)
        maps = AffordanceMaps(cells, cells)
        action = PickPlaceAction(PICK, PLACE, self.primitive, 0.8)
        return Inference(action, (200, 60), (80, 100), 0.9, 0.8, done, maps)


class Graph:
    """Everything around the server: camera, executor, a person."""

    def __init__(self, policy: FakePolicy, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(node_module, "load_policy", lambda name, compiled: policy)
        self.person = rclpy.create_node("person")
        self.server = node_module.PolicyServerNode()
        self.statuses: list[PolicyStatus] = []
        self.goals: list[PickPlace.Goal] = []
        self.poses: list[PoseStamped] = []
        self.images: dict[str, Image] = {}
        self.camera_on = self.alive = True
        self.hold = threading.Event()  # set: motions take until they are cancelled
        self.cancelled = threading.Event()
        self.plan_id = ""  # of a plan that waits for its approval, where the executor asks for one
        self.approved: list[str] = []
        self.stops = self.running = 0
        group = ReentrantCallbackGroup()
        self.instruction = self.person.create_publisher(String, "/cliport/instruction", 10)
        self.heightmap = self.person.create_publisher(HeightmapMsg, "/cliport/heightmap", 2)
        self.heartbeat = self.person.create_publisher(Empty, "/panda_executor/heartbeat", 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.person.create_subscription(PolicyStatus, "/cliport/status", self.statuses.append, latched)
        self.person.create_subscription(PoseStamped, "/cliport/pick_pose", self.poses.append, 10)
        for name in ("pick", "place", "pick/raw", "place/raw"):
            keep = self._keeper(name)
            self.person.create_subscription(Image, f"/cliport/affordance/{name}", keep, 2)
        self.answers = True  # False: the executor hangs, and its services are still discovered
        LateService(self.person, Trigger, "/panda_executor/stop", self._on_stop)
        LateService(self.person, Trigger, "/panda_executor/resume", self._on_resume)
        LateService(self.person, ApprovePlan, "/panda_executor/approve", self._on_approve)
        self.services = {
            name: self.person.create_client(Trigger, f"/cliport/{name}", callback_group=group)
            for name in ("stop", "resume")
        }
        self.approval = self.person.create_client(ApprovePlan, "/cliport/approve", callback_group=group)
        self.loading = self.person.create_client(LoadPolicy, "/cliport/load_policy", callback_group=group)
        self.action = ThreadedActionServer(
            self.person, PickPlace, "/panda_executor/pick_place", self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT, callback_group=group,
        )  # fmt: skip
        self.person.create_timer(0.1, self._beat, callback_group=group)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.person)
        self.executor.add_node(self.server)
        self.thread = threading.Thread(target=self.executor.spin, daemon=True)
        self.thread.start()

    def _keeper(self, name: str) -> Callable[[Image], None]:
        return lambda message: self.images.__setitem__(name, message)

    def _on_stop(self, _: Any, give: Give) -> None:
        self.stops += 1
        if self.answers:
            give(True, "stopped")

    def _on_resume(self, _: Any, give: Give) -> None:
        if self.answers:
            give(True, "goals are accepted")

    def _on_approve(self, request: ApprovePlan.Request, give: Give) -> None:
        if self.answers:
            self.approved.append(request.plan_id)
            give(True, f"plan {request.plan_id} is approved")

    def _beat(self) -> None:
        if self.alive:
            self.heartbeat.publish(Empty())
        if self.camera_on:
            shape = WORKSPACE.shape
            color, height = np.full((*shape, 3), 90, np.uint8), np.zeros(shape, np.float32)
            stamp_ns = self.person.get_clock().now().nanoseconds
            heightmap = Heightmap(color, height, np.ones(shape, bool), WORKSPACE, stamp_ns)
            self.heightmap.publish(heightmap_to_msg(heightmap, "panda_link0"))

    def _execute(self, handle: Any) -> PickPlace.Result:
        self.running += 1
        try:
            return self._move(handle)
        finally:
            self.running -= 1

    def _move(self, handle: Any) -> PickPlace.Result:
        self.goals.append(handle.request)
        time.sleep(0.2)  # a client drops feedback that overtakes the acceptance of its goal
        end = time.monotonic() + 60.0
        if self.plan_id:
            waits = PickPlace.Feedback(
                phase=PickPlace.Feedback.PHASE_APPROVAL, phase_name="APPROVAL", plan_id=self.plan_id
            )
            handle.publish_feedback(waits)
            while not self.approved and time.monotonic() < end:
                time.sleep(0.02)
        handle.publish_feedback(PickPlace.Feedback(phase=2, phase_name="GO_ABOVE_PICK", plan_id=self.plan_id))
        while self.hold.is_set() and time.monotonic() < end:
            if handle.is_cancel_requested:
                handle.canceled()
                self.cancelled.set()
                return PickPlace.Result(outcome=PickPlace.Result.OUTCOME_CANCELLED)
            time.sleep(0.02)
        handle.succeed()
        return PickPlace.Result(outcome=PickPlace.Result.OUTCOME_SUCCEEDED)

    def say(self, text: str) -> None:
        assert self.until(lambda: self.instruction.get_subscription_count() > 0)
        self.instruction.publish(String(data=text))

    def call(self, name: str) -> Trigger.Response:
        assert self.services[name].wait_for_service(5.0)
        future = self.services[name].call_async(Trigger.Request())
        assert self.until(future.done)
        return future.result()

    def approve(self, proposal_id: str | None = None) -> ApprovePlan.Response:
        """Approve what the newest status names, or another id."""
        assert self.approval.wait_for_service(5.0)
        named = self.statuses[-1].proposal_id if proposal_id is None else proposal_id
        future = self.approval.call_async(ApprovePlan.Request(plan_id=named))
        assert self.until(future.done)
        return future.result()

    def load(self, checkpoint: str) -> LoadPolicy.Response:
        assert self.loading.wait_for_service(5.0)
        future = self.loading.call_async(LoadPolicy.Request(checkpoint=checkpoint))
        assert self.until(future.done)
        return future.result()

    def until(self, condition: Callable[[], bool], timeout_s: float = 40.0) -> bool:
        end = time.monotonic() + timeout_s
        while time.monotonic() < end and not condition():
            time.sleep(0.02)
        return bool(condition())

    def reaches(self, state: int, timeout_s: float = 40.0) -> bool:
        return self.until(lambda: bool(self.statuses) and self.statuses[-1].state == state, timeout_s)

    def close(self) -> None:
        self.hold.clear()
        self.until(lambda: self.running == 0)
        time.sleep(0.2)  # results are on their way
        self.server.close()
        self.executor.shutdown(timeout_sec=2.0)
        self.thread.join(2.0)
        self.person.destroy_node()
        self.server.destroy_node()
        rclpy.try_shutdown()
