"""The server's node among fakes: perception's topic, an executor's action, and a policy that knows."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cliport_interfaces.msg")

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.action import CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_domain import next_domain
from sensor_msgs.msg import Image
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.messages import depth_from_msg, heightmap_to_msg, planar_pose_from_msg
from cliport_core.pose import PlanarPose
from cliport_core.ros_action_server import ThreadedActionServer
from cliport_core.workspace import WorkspaceSpec
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import PolicyStatus
from cliport_interfaces.srv import ApprovePlan, LoadPolicy
from cliport_policy import node as node_module
from cliport_policy.errors import CheckpointError, InstructionError
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
        self.person.create_service(Trigger, "/panda_executor/stop", self._on_stop, callback_group=group)
        self.person.create_service(Trigger, "/panda_executor/resume", self._on_resume, callback_group=group)
        self.person.create_service(ApprovePlan, "/panda_executor/approve", self._on_approve, callback_group=group)
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

    def _on_stop(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        self.stops += 1
        response.success = True
        return response

    def _on_resume(self, _: Any, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        return response

    def _on_approve(self, request: ApprovePlan.Request, response: ApprovePlan.Response) -> ApprovePlan.Response:
        self.approved.append(request.plan_id)
        response.success = True
        return response

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


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Graph]]:
    made: list[Graph] = []

    def make(steps: int = 2, primitive: Primitive = Primitive.PICK_PLACE, **parameters: object) -> Graph:
        arguments = [v for k, value in parameters.items() for v in ("-p", f"{k}:={value}")]
        rclpy.init(
            args=["--ros-args", *arguments] if arguments else None,
            domain_id=next_domain(),
        )
        made.append(Graph(FakePolicy(steps, primitive), monkeypatch))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_an_instruction_becomes_goals_until_it_is_done(graph: Callable[..., Graph]) -> None:
    world = graph(steps=2)
    assert world.reaches(PolicyStatus.STATE_IDLE)
    world.say("put the red blocks in the green bowl")
    assert world.reaches(PolicyStatus.STATE_DONE)
    assert world.statuses[-1].message == "the goal looks reached after 2 steps"
    assert len(world.goals) == 2
    goal = world.goals[0]
    assert (goal.header.frame_id, goal.instruction) == ("panda_link0", "put the red blocks in the green bowl")
    assert planar_pose_from_msg(goal.place).yaw == pytest.approx(PLACE.yaw)
    assert world.until(lambda: len(world.images) == 4)
    assert world.images["pick"].encoding == "rgb8"
    assert depth_from_msg(world.images["place/raw"]).shape == WORKSPACE.shape
    assert world.poses[-1].pose.position.x == pytest.approx(PICK.x)
    assert any("GO_ABOVE_PICK" in status.message for status in world.statuses)


@pytest.mark.parametrize("primitive", list(Primitive))
def test_what_the_policy_chose_is_what_is_asked_for(graph: Callable[..., Graph], primitive: Primitive) -> None:
    world = graph(steps=1, primitive=primitive, require_approval=True)
    world.say("put the red blocks in the green bowl")
    assert world.reaches(PolicyStatus.STATE_WAITING_FOR_APPROVAL)
    assert world.statuses[-1].primitive == primitive
    assert world.approve().success
    assert world.reaches(PolicyStatus.STATE_DONE)
    assert [goal.primitive for goal in world.goals] == [primitive]


def test_stop_cancels_latches_and_is_passed_on(graph: Callable[..., Graph]) -> None:
    world = graph()
    world.hold.set()
    world.say("put the red blocks in the green bowl")
    assert world.until(lambda: bool(world.goals))
    assert world.call("stop").success
    assert world.cancelled.wait(5.0)
    assert world.until(lambda: world.stops == 1)
    assert world.reaches(PolicyStatus.STATE_IDLE)
    world.say("put the red blocks in the green bowl")
    assert world.reaches(PolicyStatus.STATE_FAILED)
    assert "resume" in world.statuses[-1].message
    world.hold.clear()
    assert world.call("resume").success
    world.say("put the red blocks in the green bowl")
    assert world.reaches(PolicyStatus.STATE_DONE)


def test_approval_is_waited_for(graph: Callable[..., Graph]) -> None:
    world = graph(steps=1, require_approval=True)
    assert not world.approve("12ab34cd").success
    world.say("put the red blocks in the green bowl")
    assert world.reaches(PolicyStatus.STATE_WAITING_FOR_APPROVAL)
    assert world.statuses[-1].confidence == 0.8 and not world.goals
    assert not world.approve("").success and not world.goals
    assert world.approve().success
    assert world.reaches(PolicyStatus.STATE_DONE)


def test_a_plan_that_waits_at_the_executor_is_approved_by_its_id(graph: Callable[..., Graph]) -> None:
    world = graph(steps=1)
    world.plan_id = "1a2b3c4d"
    world.say("put the red blocks in the green bowl")
    assert world.until(lambda: bool(world.statuses) and world.statuses[-1].proposal_id == "1a2b3c4d")
    assert world.statuses[-1].state == PolicyStatus.STATE_EXECUTING
    assert not world.approve("").success and not world.approved
    assert world.approve().success
    assert world.reaches(PolicyStatus.STATE_DONE)
    assert world.approved == ["1a2b3c4d"] and world.statuses[-1].proposal_id == ""


def test_another_policy_is_loaded_while_nothing_goes_on(
    graph: Callable[..., Graph], monkeypatch: pytest.MonkeyPatch
) -> None:
    world = graph(steps=0)
    world.hold.set()

    def load(name: str, compiled: bool) -> FakePolicy:
        if name == "mine":
            return FakePolicy(steps=1)
        raise CheckpointError(f"there is no checkpoint\n{name}") if name == "absent" else MemoryError("none left")

    monkeypatch.setattr(node_module, "load_policy", load)
    for name, words in (("absent", "there is no checkpoint absent"), ("large", "MemoryError: none left")):
        assert world.load(name).success
        assert world.until(lambda said=words: world.statuses[-1].message == f"{said}; the present policy stays")
    world.say("move a block")
    assert world.reaches(PolicyStatus.STATE_DONE) and not world.goals
    answer = world.load("mine")
    assert (answer.success, answer.message) == (True, "loading the policy mine")
    assert world.until(lambda: world.statuses[-1].message == "the policy mine is loaded")
    world.say("move a block")
    assert world.until(lambda: bool(world.goals))
    answer = world.load("mine")
    assert (answer.success, answer.message) == (False, "the server is EXECUTING: end that first")
    world.hold.clear()
    assert world.reaches(PolicyStatus.STATE_DONE)


def test_faults_end_in_one_line(graph: Callable[..., Graph]) -> None:
    world = graph(steps=9, observation_timeout=1.0)
    for text, words in (("x" * 1_000_000, "1000000 characters"), ("fnord", "not understood")):
        count = len(world.statuses)
        world.say(text)
        assert world.until(lambda n=count: len(world.statuses) > n)
        assert world.reaches(PolicyStatus.STATE_FAILED)
        assert words in world.statuses[-1].message
    world.server._policy.error = RuntimeError("tensors\ndo not fit")
    world.say("move a block")
    assert world.until(lambda: world.statuses[-1].message == "inference failed: RuntimeError: tensors do not fit")
    world.server._policy.error = None
    world.camera_on = False
    time.sleep(0.3)
    world.say("move a block")
    assert world.until(lambda: world.statuses[-1].message.startswith("no fresh heightmap for 1.0 s"))
    assert not world.goals
    world.camera_on = True
    world.hold.set()
    world.say("move a block")
    assert world.until(lambda: "GO_ABOVE_PICK" in world.statuses[-1].message)
    world.alive = False
    assert world.until(lambda: world.statuses[-1].message.startswith("executor lost: no heartbeat"))


def test_a_corrupt_checkpoint_ends_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(name: str, compiled: bool) -> None:
        raise CheckpointError(f"checkpoint {name} is damaged: restore it or train again")

    monkeypatch.setattr(node_module, "load_policy", refuse)
    assert node_module.main(["--ros-args", "-p", "checkpoint:=/tmp/broken"]) == 1
    assert capsys.readouterr().err == "error: checkpoint /tmp/broken is damaged: restore it or train again\n"
