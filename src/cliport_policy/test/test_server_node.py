"""The server's node among fakes: perception's topic, an executor's action, and a policy that knows."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("cliport_interfaces.msg")

import rclpy
from ros_domain import next_domain
from server_graph import PICK, PLACE, WORKSPACE, FakePolicy, Graph

from cliport_core.action import Primitive
from cliport_core.messages import depth_from_msg, planar_pose_from_msg
from cliport_interfaces.msg import PolicyStatus
from cliport_policy import node as node_module
from cliport_policy.errors import CheckpointError


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


def test_an_executor_that_hangs_is_not_said_to_be_stopped(graph: Callable[..., Graph]) -> None:
    world = graph(steps=1)
    world.plan_id = "1a2b3c4d"
    world.say("put the red blocks in the green bowl")
    assert world.until(lambda: bool(world.statuses) and world.statuses[-1].proposal_id == "1a2b3c4d")
    world.answers = False
    began = time.monotonic()
    answer = world.approve()
    assert (answer.success, answer.message) == (
        False,
        "the executor did not answer: whether it runs the plan is not known",
    )
    assert time.monotonic() - began < 10.0
    world.hold.set()
    answer = world.call("stop")
    assert not answer.success and "the executor did not answer; the arm may still move" in answer.message
    assert world.until(lambda: world.statuses[-1].message == answer.message)
    assert not world.call("resume").success
    world.answers = True
    assert world.call("stop").message == "stopped: call /cliport/resume to go on"
    assert world.until(lambda: world.statuses[-1].message == "stopped: call /cliport/resume to go on")
    answer = world.call("resume")
    assert (answer.success, answer.message) == (True, "ready for an instruction")
    world.approved.append("")  # its motion ends


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
    answer = world.approve()
    assert (answer.success, answer.message) == (True, "plan 1a2b3c4d is approved")
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
