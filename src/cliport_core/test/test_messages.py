from __future__ import annotations

import math

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from cliport_core import (
    ActionGoal,
    ActionResult,
    GoalError,
    Heightmap,
    ImageError,
    Outcome,
    PickPlaceAction,
    PlanarPose,
    Pose,
    Primitive,
    WorkspaceError,
    WorkspaceSpec,
)
from cliport_core import messages as c
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_interfaces.action import PickPlace
from cliport_interfaces.msg import PolicyStatus

FRAME = "panda_link0"
STAMP = 1_722_222_222_123_456_789


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


@pytest.mark.parametrize("stamp_ns", [0, 1, 999_999_999, 1_000_000_000, 1_722_222_222_123_456_789])
def test_stamps(stamp_ns: int) -> None:
    assert c.stamp_from_msg(c.stamp_to_msg(stamp_ns)) == stamp_ns


@pytest.mark.parametrize("seed", range(5))
def test_poses_and_transforms(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = Pose.from_quaternion_xyzw(rng.normal(size=4), rng.normal(size=3))
    assert c.pose_from_msg(c.pose_to_msg(pose)).is_close(pose)
    assert c.pose_from_transform_msg(c.pose_to_transform_msg(pose)).is_close(pose)


def close(pose: PlanarPose) -> object:
    return pytest.approx((pose.x, pose.y, pose.yaw))


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.9, 3.1])
def test_planar_poses(yaw: float) -> None:
    pose = PlanarPose(0.45, -0.1, yaw)
    message = over_the_wire(c.planar_pose_to_msg(pose))
    assert message.position.z == 0.0
    back = c.planar_pose_from_msg(message)
    assert (back.x, back.y, back.yaw) == close(pose)
    stamped = over_the_wire(c.pose_stamped_to_msg(pose, FRAME, STAMP))
    assert (stamped.header.frame_id, c.stamp_from_msg(stamped.header.stamp)) == (FRAME, STAMP)
    assert stamped.pose == message
    message.position.y = math.nan
    with pytest.raises(ValueError, match="finite"):
        c.planar_pose_from_msg(message)


@pytest.mark.parametrize("primitive", list(Primitive))
@pytest.mark.parametrize("plan_only", [False, True])
def test_goals(primitive: Primitive, plan_only: bool) -> None:
    action = PickPlaceAction(PlanarPose(0.45, 0.1, 0.7), PlanarPose(0.5, -0.2, -2.9), primitive, 0.8)
    message = over_the_wire(c.goal_to_msg(ActionGoal(action, "sweep it up", STAMP, plan_only), FRAME))
    assert message.header.frame_id == FRAME
    assert message.primitive == getattr(PickPlace.Goal, f"PRIMITIVE_{primitive.name}")
    back = c.goal_from_msg(message, FRAME)
    assert (back.instruction, back.stamp_ns, back.plan_only) == ("sweep it up", STAMP, plan_only)
    assert (back.action.primitive, back.action.confidence) == (primitive, None)
    for a, b in ((back.action.pick, action.pick), (back.action.place, action.place)):
        assert (a.x, a.y, a.yaw) == close(b)


def goal_message(**changes: object) -> PickPlace.Goal:
    action = PickPlaceAction(PlanarPose(0.45, 0.1, 0.0), PlanarPose(0.5, 0.0, 0.0))
    message = c.goal_to_msg(ActionGoal(action), FRAME)
    for path, value in changes.items():
        owner: object = message
        *parents, last = path.split("__")
        for name in parents:
            owner = getattr(owner, name)
        setattr(owner, last, value)
    return message


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (goal_message(header__frame_id="map"), "must be in frame 'panda_link0', got 'map'"),
        (goal_message(primitive=7), r"unknown primitive 7; known are 0 \(pick_place\), 1 \(sweep\), 2 \(fold\)"),
        (goal_message(pick__position__x=math.nan), "the pick pose cannot be used"),
        (goal_message(place__orientation__w=0.0), "the place pose cannot be used"),
    ],
)
def test_goals_that_cannot_be_used(message: PickPlace.Goal, words: str) -> None:
    with pytest.raises(GoalError, match=words) as caught:
        c.goal_from_msg(message, FRAME)
    assert "\n" not in str(caught.value)


def test_a_goal_without_a_frame_is_in_the_base() -> None:
    assert c.goal_from_msg(goal_message(header__frame_id=""), FRAME).action.pick.x == 0.45


@pytest.mark.parametrize("outcome", list(Outcome))
def test_results(outcome: Outcome) -> None:
    assert getattr(PickPlace.Result, f"OUTCOME_{outcome.name}") == outcome
    message = over_the_wire(c.result_to_msg(ActionResult(outcome, "two\nlines  here", (0.45, 0.1, 0.03), 0.04)))
    assert c.result_from_msg(message) == ActionResult(outcome, "two lines here", (0.45, 0.1, 0.03), 0.04)
    assert c.result_from_msg(c.result_to_msg(ActionResult(outcome, ""))) == ActionResult(outcome, "")


def test_a_result_is_a_success_only_where_the_action_ended_well() -> None:
    for outcome in Outcome:
        ended = c.result_from_msg(c.result_to_msg(ActionResult(outcome, "")), ended_well=False).outcome
        assert ended is (Outcome.EXECUTION_FAILED if outcome.is_success else outcome)
    assert c.result_from_msg(PickPlace.Result(), ended_well=False).outcome is Outcome.EXECUTION_FAILED


def test_an_unknown_outcome_is_a_failed_execution() -> None:
    assert c.result_from_msg(PickPlace.Result(outcome=99)).outcome is Outcome.EXECUTION_FAILED


@pytest.mark.parametrize("state", list(PolicyState))
def test_statuses(state: PolicyState) -> None:
    assert getattr(PolicyStatus, f"STATE_{state.name}") == state
    status = ServerStatus(state, "step 2: CARRY", "sweep it up", 2, 0.75, Primitive.SWEEP, "12ab34cd")
    message = over_the_wire(c.status_to_msg(status, 8, STAMP))
    assert (message.max_steps, c.stamp_from_msg(message.header.stamp)) == (8, STAMP)
    acts = state in (PolicyState.WAITING_FOR_APPROVAL, PolicyState.EXECUTING)
    bare = ServerStatus(state, "step 2: CARRY", "sweep it up", 2)
    assert c.status_from_msg(message) == (status if acts else bare)
    assert c.status_to_msg(bare, 8, STAMP).confidence == 0.0


@pytest.mark.parametrize("said", [-0.1, 1.5, math.nan])
def test_a_confidence_that_is_no_share_of_one_is_not_known(said: float) -> None:
    message = PolicyStatus(state=PolicyStatus.STATE_WAITING_FOR_APPROVAL, confidence=said)
    assert c.status_from_msg(message).confidence is None


@pytest.mark.parametrize("change", [{"state": 99}, {"state": PolicyStatus.STATE_WAITING_FOR_APPROVAL, "primitive": 99}])
def test_what_a_newer_server_says_is_a_failure_in_words(change: dict[str, int]) -> None:
    status = c.status_from_msg(PolicyStatus(instruction="sweep it up", confidence=0.5, **change))
    assert status.state is PolicyState.FAILED and "99" in status.message and status.instruction == "sweep it up"
    assert status.confidence is None


def test_an_arm_that_moves_in_an_unknown_way_moves() -> None:
    message = PolicyStatus(state=PolicyStatus.STATE_EXECUTING, message="step 1", primitive=99, confidence=0.5)
    status = c.status_from_msg(message)
    assert (status.state, status.message, status.confidence) == (PolicyState.EXECUTING, "step 1", 0.5)


@pytest.mark.parametrize("primitive", list(Primitive))
def test_primitives_have_labels(primitive: Primitive) -> None:
    assert Primitive.from_label(primitive.label) is primitive
    with pytest.raises(ValueError, match="unknown primitive 'push': known are pick_place, sweep, fold"):
        Primitive.from_label("push")


def test_workspace() -> None:
    spec = WorkspaceSpec(x_min=0.3, x_max=0.5, n_rotations=12)
    assert c.workspace_from_msg(over_the_wire(c.workspace_to_msg(spec))) == spec
    with pytest.raises(WorkspaceError):
        c.workspace_from_msg(c.WorkspaceSpecMsg())


def test_images() -> None:
    rng = np.random.default_rng(0)
    color = rng.integers(0, 256, (6, 8, 3), dtype=np.uint8)
    np.testing.assert_array_equal(c.color_from_msg(over_the_wire(c.image_to_msg(color, "rgb8"))), color)
    depth = rng.uniform(0.5, 2.0, (6, 8)).astype(np.float32)
    np.testing.assert_array_equal(c.depth_from_msg(over_the_wire(c.image_to_msg(depth, "32FC1"))), depth)
    message = c.image_to_msg(depth.astype(">f4")[:, ::2], "32FC1")
    np.testing.assert_array_equal(c.depth_from_msg(message), depth[:, ::2])


def test_heightmap() -> None:
    rng, workspace = np.random.default_rng(1), WorkspaceSpec()
    heightmap = Heightmap(
        rng.integers(0, 256, (*workspace.shape, 3), dtype=np.uint8),
        rng.normal(size=workspace.shape).astype(np.float32),
        rng.random(workspace.shape) > 0.5,
        workspace,
        1_234_567_890_123,
    )
    message = over_the_wire(c.heightmap_to_msg(heightmap, "panda_link0"))
    assert message.header.frame_id == message.height.header.frame_id == "panda_link0"
    back = c.heightmap_from_msg(message)
    assert (back.workspace, back.stamp_ns) == (heightmap.workspace, heightmap.stamp_ns)
    for name in ("color", "height", "valid"):
        np.testing.assert_array_equal(getattr(back, name), getattr(heightmap, name))
    message.height.encoding = "16UC1"
    with pytest.raises(ImageError, match="heightmap height must be"):
        c.heightmap_from_msg(message)


def test_numbers_are_those_of_the_interfaces() -> None:
    for names, kind, prefix in (
        (PolicyState, PolicyStatus, "STATE"),
        (Outcome, PickPlace.Result, "OUTCOME"),
        (Primitive, PickPlace.Goal, "PRIMITIVE"),
    ):
        assert [each.value for each in names] == [getattr(kind, f"{prefix}_{each.name}") for each in names]
        stated = [name for name in dir(type(kind)) + dir(kind) if name.startswith(f"{prefix}_")]
        assert len(set(stated)) == len(names)
