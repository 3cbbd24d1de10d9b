"""The real node over real middleware: camera, executor and policy server are a few publishers and servers."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped
from made_anew import MadeAnew
from rclpy.action import CancelResponse
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from ros_domain import next_domain
from sensor_msgs.msg import CameraInfo, Image, JointState
from station_fakes import BLOCKS, FakeTable
from std_msgs.msg import Empty, String
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from cliport_core import messages as shared
from cliport_core.pose import PlanarPose
from cliport_core.ros_action_server import ThreadedActionServer
from cliport_core.ros_running import SpinThread
from cliport_episodes.bags import decode, read_messages
from cliport_episodes.data_set import DataSet
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import PolicyStatus
from cliport_perception.conversions import camera_to_msg
from demo_tool import ros_arm
from demo_tool.errors import StationError
from demo_tool.ros_link import RosLink
from demo_tool.station import Station

FRAME = "camera_color_optical_frame"
PATIENCE = 5.0  # s; both ends share a process, on a machine that may be busy, so that signs of life come late
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class World:
    """The other end of every topic, in a node of its own."""

    def __init__(self) -> None:
        self.table = FakeTable()
        self.view = self.table.live_view(0)  # rendered once: it takes most of a period
        self.node = node = rclpy.create_node("cliport_policy")  # parameters are asked of this name
        node.declare_parameter("require_approval", True)
        sensor = qos_profile_sensor_data
        self.color = node.create_publisher(Image, "/camera/color/image_raw", sensor)
        self.depth = node.create_publisher(Image, "/camera/aligned_depth_to_color/image_raw", sensor)
        self.info = node.create_publisher(CameraInfo, "/camera/color/camera_info", sensor)
        self.tf = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        self.joints = node.create_publisher(JointState, "/joint_states", sensor)
        self.beats = node.create_publisher(Empty, "/panda_executor/heartbeat", 10)
        self.status = node.create_publisher(PolicyStatus, "/cliport/status", LATCHED)
        self.poses = {
            kind: node.create_publisher(PoseStamped, f"/cliport/{kind}_pose", 2) for kind in ("pick", "place")
        }
        node.create_subscription(String, "/cliport/instruction", self._on_instruction, 10)
        self.confidence = 0.75
        self.heard: list[str] = []
        self.called: list[str] = []
        self.may_answer = threading.Event()
        self.may_answer.set()
        names = ("/panda_executor/stop", "/cliport/stop", "/panda_executor/resume", "/cliport/resume")
        self.triggers = {
            name: node.create_service(Trigger, name, lambda _, response, name=name: self._on_trigger(name, response))
            for name in names
        }
        self.goals: list[PickPlace.Goal] = []
        self.hold = threading.Event()
        self.hold.set()
        self.server = self.start_executor()
        node.create_timer(0.05, lambda: self.beats.publish(Empty()))
        node.create_timer(0.1, self.publish)
        link = TransformStamped(child_frame_id=FRAME)
        link.header.frame_id = "panda_link0"
        link.transform = shared.pose_to_transform_msg(self.table.camera_in_base)
        self.tf.publish(TFMessage(transforms=[link]))

    def do(self, act: Callable[[], object]) -> None:
        """Call a function in the node's thread."""
        self.node.executor.create_task(act)

    def start_executor(self) -> ThreadedActionServer:
        return ThreadedActionServer(
            self.node, PickPlace, "/panda_executor/pick_place", self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def publish(self) -> None:
        stamp = self.node.get_clock().now().to_msg()
        messages = (
            (self.info, camera_to_msg(self.view.camera)),
            (self.color, shared.image_to_msg(self.view.color, "rgb8")),
            (self.depth, shared.image_to_msg(self.view.depth_m, "32FC1")),
            (self.joints, JointState(name=["panda_joint1"], position=[0.5])),
            (self.joints, JointState(name=["panda_finger_joint1"], position=[0.04])),
        )
        for publisher, message in messages:
            message.header.stamp, message.header.frame_id = stamp, FRAME
            publisher.publish(message)

    def _execute(self, handle) -> PickPlace.Result:
        self.goals.append(handle.request)
        for number, name in enumerate(("VALIDATING", "GO_ABOVE_PICK", "CARRY")):
            handle.publish_feedback(PickPlace.Feedback(phase=number, phase_name=name, progress=number / 3))
            while not self.hold.wait(0.02):
                if handle.is_cancel_requested:
                    handle.canceled()
                    return PickPlace.Result(outcome=PickPlace.Result.OUTCOME_CANCELLED, message="the arm holds")
        handle.succeed()
        planned, done = PickPlace.Result.OUTCOME_PLANNED, PickPlace.Result.OUTCOME_SUCCEEDED
        return PickPlace.Result(
            outcome=planned if handle.request.plan_only else done, message="done", gripper_width=0.04
        )

    def _on_trigger(self, name: str, response: Trigger.Response) -> Trigger.Response:
        self.may_answer.wait(60.0)
        self.called.append(name)
        response.success = True
        return response

    def _on_instruction(self, message: String) -> None:
        self.heard.append(message.data)
        if not message.data:
            self.status.publish(PolicyStatus(state=PolicyStatus.STATE_IDLE))
            return
        stamp = self.node.get_clock().now().to_msg()
        for kind, pose in (("pick", PlanarPose(0.42, -0.12, 0.0)), ("place", PlanarPose(0.5, -0.28, 1.0))):
            sent = PoseStamped(pose=shared.planar_pose_to_msg(pose))
            sent.header.stamp, sent.header.frame_id = stamp, "panda_link0"
            self.poses[kind].publish(sent)
        waiting = PolicyStatus.STATE_WAITING_FOR_APPROVAL
        self.status.publish(
            PolicyStatus(
                state=waiting,
                instruction=message.data,
                message="waiting",
                confidence=self.confidence,
                primitive=PickPlace.Goal.PRIMITIVE_SWEEP,
            )
        )


class Rig:
    """A station on the real node, beside the world."""

    def __init__(self, root: Path) -> None:
        self.root, self.world = root, World()
        self.link = RosLink()
        config = replace(self.link.config, max_age=PATIENCE, silence=2 * PATIENCE)
        self.station = Station(config, self.link.arm, self.link.policy, root)
        self.link.attach(self.station)

    def do(self, command: str, /, **arguments) -> dict:
        return self.station.command(command, arguments)

    @property
    def view(self) -> dict:
        return self.station.view(None)

    def until(self, condition: Callable[[dict], bool], timeout: float = 30.0) -> dict:
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            view = self.view
            if condition(view):
                return view
            time.sleep(0.02)
        raise AssertionError(f"still {self.view['state']}: {self.view['words']} {self.view['last']}")

    def ready(self) -> dict:
        return self.until(lambda view: view["state"] == "ready")

    def draw(self) -> None:
        table = self.world.table
        self.do("pick", box=table.box_around(BLOCKS[0]), rotation=0)
        self.do("place", box=table.box_at(0.5, -0.28), rotation=9)


@contextmanager
def running(folder: Path) -> Iterator[Rig]:
    """A rig whose nodes spin; folder: of its data sets."""
    patch = pytest.MonkeyPatch()
    patch.setattr(ros_arm, "_HEARTBEAT_TIMEOUT", PATIENCE)
    rclpy.init(domain_id=next_domain())
    made = Rig(folder)
    faults: list[BaseException] = []
    spinners = [SpinThread(node, faults.append) for node in (made.world.node, made.link)]
    made.ready()
    made.until(lambda _: made.world.joints.get_subscription_count() > 0)
    time.sleep(0.5)  # several of what is published from now on have arrived
    made.until(lambda _: made.link.arm.fault() is None)
    made.do("open_data_set", name="blocks")
    made.do("instruction", text="put the red block aside")
    yield made
    made.world.hold.set()
    made.link.close()
    time.sleep(0.2)  # the last goal's thread ends
    for spinner in spinners:
        spinner.stop()
    rclpy.try_shutdown()
    patch.undo()
    assert not faults


@pytest.fixture(scope="module")
def rigs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MadeAnew[Rig]]:
    with MadeAnew(lambda: running(tmp_path_factory.mktemp("sets"))) as made:
        yield made


@pytest.fixture
def rig(rigs: MadeAnew[Rig], request: pytest.FixtureRequest) -> Rig:
    return rigs.of(request)


def test_a_step_goes_from_the_picture_through_the_executor_into_a_bag(rig: Rig) -> None:
    rig.draw()
    rig.do("preview")
    rig.until(lambda view: view["plan"] is not None)
    assert rig.world.goals[-1].plan_only and rig.view["plan"]["reachable"]
    rig.do("execute")
    rig.until(lambda view: view["state"] == "ready" and view["episode"] and view["episode"]["steps"])
    goal = rig.world.goals[-1]
    assert (
        not goal.plan_only and goal.header.frame_id == "panda_link0" and goal.instruction == "put the red block aside"
    )
    rig.do("end_episode", success=True)
    data_set = DataSet.open(rig.root / "blocks")
    episode = data_set.episode(data_set.episodes()[0].name)
    assert not episode.complaints and episode.final is not None and episode.success
    (step,) = episode.steps
    assert step.record.action.pick.x == pytest.approx(goal.pick.position.x)
    assert step.record.result is not None and step.record.result.gripper_width == 0.04
    assert step.record.stamp_ns == shared.stamp_from_msg(goal.header.stamp)
    observation = step.observation()
    assert np.array_equal(observation.color, rig.world.view.color)
    assert observation.camera_in_base.is_close(rig.world.table.camera_in_base, 1e-6)
    joints = [decode(raw).name for raw in read_messages(step.path) if raw.topic == "/joint_states"]
    assert sorted(joints) == [["panda_finger_joint1"], ["panda_joint1"]]  # from two publishers, both kept


def test_a_check_that_is_asked_by_itself_gives_way_to_a_motion(rig: Rig) -> None:
    rig.world.hold.clear()
    before = len(rig.world.goals)
    rig.draw()
    rig.until(lambda _: len(rig.world.goals) > before)
    assert rig.world.goals[-1].plan_only and rig.view["state"] == "ready"
    rig.do("execute")
    rig.until(lambda _: not rig.world.goals[-1].plan_only)
    assert len(rig.world.goals) == before + 2
    rig.world.hold.set()
    rig.until(lambda view: view["state"] == "ready" and view["episode"] and view["episode"]["steps"])
    rig.do("discard_episode")


def test_stop_reaches_all_who_move(rig: Rig) -> None:
    rig.world.hold.clear()
    rig.draw()
    rig.do("execute")
    rig.until(lambda view: len(rig.world.goals) > 0 and view["phase"] == "checking the request")
    called = len(rig.world.called)
    rig.world.may_answer.clear()
    rig.do("stop")
    assert rig.view["state"] == "stopped" and len(rig.world.called) == called, "it waits for nobody's answer"
    rig.world.may_answer.set()
    rig.until(lambda _: {"/panda_executor/stop", "/cliport/stop"} <= set(rig.world.called))
    rig.until(lambda view: "still" not in view["words"])
    assert "nothing was recorded; stopped on the way: the arm holds" in rig.view["last"]["words"]
    with pytest.raises(StationError, match="resume first"):
        rig.do("execute")
    rig.world.hold.set()
    rig.do("resume")
    rig.until(lambda _: {"/panda_executor/resume", "/cliport/resume"} <= set(rig.world.called))
    rig.ready()


def test_a_proposal_is_fetched_and_dropped(rig: Rig) -> None:
    rig.do("propose")
    proposal = rig.until(lambda view: view["policy"]["proposal"])["policy"]["proposal"]
    assert (proposal["pick_rotation"], proposal["place_rotation"]) == (0, 6) and proposal["confidence"] == 0.75
    rig.until(lambda _: rig.world.heard == ["put the red block aside", ""])
    rig.do("correct")
    assert rig.view["draft"]["source"] == "proposed" and rig.view["primitive"] == "sweep"
    rig.world.node.set_parameters([Parameter("require_approval", value=False)])
    rig.do("propose")
    rig.until(lambda view: "without asking" in view["last"]["words"])
    assert len(rig.world.heard) == 2


def test_a_stop_that_is_not_answered_is_said(rig: Rig) -> None:
    rig.world.may_answer.clear()
    try:
        rig.do("stop")
        rig.until(lambda view: "STOP did not reach the executor" in view["last"]["words"])
        assert not rig.view["last"]["ok"] and "STOP did not reach" in rig.view["words"]
    finally:
        rig.world.may_answer.set()
        rig.do("resume")
    rig.until(lambda _: rig.link.arm.fault() is None)
    rig.ready()


def test_pictures_come_to_those_who_ask(rig: Rig) -> None:
    first = rig.station.picture("color", 0, 2.0)
    assert first is not None and first.pixels.shape == (270, 480, 3)
    then = rig.station.picture("color", first.sequence, 2.0)
    assert then is not None and then.stamp_ns > first.stamp_ns


def test_an_executor_that_dies_on_the_way(rig: Rig) -> None:
    rig.world.hold.clear()
    rig.draw()
    rig.do("execute")
    rig.until(lambda view: view["phase"] == "checking the request")
    rig.world.beats.publish = lambda _: None
    words = rig.until(lambda view: view["state"] == "failed")["last"]["words"]
    assert "the arm was lost: the executor gives no sign of life" in words
    with pytest.raises(StationError, match="no sign of life"):
        rig.do("execute")
    rig.until(lambda _: int(re.search(r"no sign of life for (\d+) s", rig.link.arm.fault())[1]) > 2)


def test_an_executor_whose_stop_cannot_be_reached_is_not_asked_to_move(rig: Rig) -> None:
    rig.draw()
    rig.world.do(lambda: rig.world.node.destroy_service(rig.world.triggers["/panda_executor/stop"]))
    rig.until(lambda _: "stop cannot be reached" in (rig.link.arm.fault() or ""))
    with pytest.raises(StationError, match="stop cannot be reached"):
        rig.do("execute")


def test_a_policy_server_that_goes_is_noticed(rig: Rig) -> None:
    rig.world.status.publish(PolicyStatus(state=PolicyStatus.STATE_EXECUTING, message="carrying"))
    rig.until(lambda view: view["policy"]["state"] == "executing")
    time.sleep(1.2)  # the graph has been looked at since
    assert rig.view["policy"]["state"] == "executing"
    rig.world.do(lambda: rig.world.node.destroy_publisher(rig.world.status))
    rig.until(lambda view: view["policy"]["state"] == "absent")
