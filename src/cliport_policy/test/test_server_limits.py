"""The server's limits, to either side of each, and what a status says besides its state."""

from __future__ import annotations

from typing import Any

import pytest
from server_world import GOAL, S, World

from cliport_core.action import Primitive
from cliport_core.outcome import Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_policy.errors import ConfigError
from cliport_policy.server.types import Moment, ServerConfig

DEFAULTS = {
    "max_steps": 20, "require_approval": False, "done_threshold": 0.5, "absent_threshold": 0.5, "min_confidence": 0.02,
    "retries": 2, "max_observation_age": 1.0, "look_back": 0.0, "observation_timeout": 3.0, "settle": 0.2,
    "inference_timeout": 30.0, "max_proposal_age": 60.0, "executor_timeout": 5.0, "heartbeat_timeout": 1.0,
    "goal_timeout": 120.0, "cancel_timeout": 5.0,
}  # fmt: skip


def test_limits_that_nobody_set() -> None:
    assert vars(ServerConfig()) == DEFAULTS


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"max_steps": 1}, ""), ({"max_steps": 0}, "got 0, 2"), ({"retries": 0}, ""), ({"retries": -1}, "got 20, -1"),
        ({"done_threshold": 0.0, "absent_threshold": 1.0}, ""), ({"done_threshold": -0.1}, "done_threshold must be in"),
        ({"absent_threshold": 1.1}, "absent_threshold must be in 0..1, got 1.1"), ({"min_confidence": 2}, "min_conf"),
        ({"settle": 0.0, "look_back": 0.5}, ""), ({"look_back": -0.1}, "look_back must be 0 or more"),
        ({"cancel_timeout": 0.01}, ""), ({"cancel_timeout": 0.0}, "cancel_timeout must be positive, got 0.0"),
        ({"max_proposal_age": -1.0}, "max_proposal_age must be positive"),
    ],
)  # fmt: skip
def test_settings_to_either_side_of_their_bounds(settings: dict[str, Any], words: str) -> None:
    if not words:
        ServerConfig(**settings)
        return
    with pytest.raises(ConfigError, match=words):
        ServerConfig(**settings)


def thinking(**settings: Any) -> World:
    world = World(**settings)
    world.say()
    world.see()
    assert world.state == PolicyState.PROPOSING
    return world


@pytest.mark.parametrize(
    ("answer", "state"),
    [
        ({"done": 0.5}, PolicyState.DONE),
        ({"done": 0.49, "absent": 0.5}, PolicyState.FAILED),
        ({"done": 0.6, "absent": 0.7}, PolicyState.FAILED),
        ({"done": 0.7, "absent": 0.7}, PolicyState.DONE),
        ({"done": 0.49, "absent": 0.49}, PolicyState.EXECUTING),
        ({"confidence": 0.02}, PolicyState.EXECUTING),
        ({"confidence": 0.019}, PolicyState.FAILED),
    ],
)
def test_an_answer_at_its_threshold(answer: dict[str, float], state: PolicyState) -> None:
    world = thinking()
    world.think(**answer)
    assert world.state == state and len(world.goals) == (state == PolicyState.EXECUTING)


def test_an_unsure_answer_says_how_unsure() -> None:
    world = thinking(min_confidence=0.25)
    world.think(confidence=0.125)
    assert world.message == "not sure enough where to act (pick 0.12, place 0.12, at least 0.25 needed)"


def test_a_status_shows_the_action_only_while_it_matters() -> None:
    world = thinking(require_approval=True)
    world.think(primitive=Primitive.SWEEP, confidence=0.75)
    waiting = world.statuses[-1]
    assert (waiting.confidence, waiting.primitive, waiting.step) == (0.75, Primitive.SWEEP, 0) and waiting.proposal_id
    world.agree()
    words = "step 1: asking the executor"
    assert world.statuses[-1] == ServerStatus(PolicyState.EXECUTING, words, GOAL, 1, 0.75, Primitive.SWEEP)
    world.accept()
    world.end()
    assert world.statuses[-1] == ServerStatus(PolicyState.OBSERVING, "step 1 done, looking again", GOAL, 1)


@pytest.mark.parametrize(("age", "state"), [(1.0, PolicyState.PROPOSING), (1.001, PolicyState.OBSERVING)])
def test_a_heightmap_may_be_as_old_as_the_limit(age: float, state: PolicyState) -> None:
    world = World(max_observation_age=1.0, observation_timeout=60.0)
    world.say()
    for sign in (-1, 1):  # a stamp of the future is of another clock
        later = Moment(world.now.wall + 5.0, world.now.ros_ns + 5 * S)
        world.server.on_observation(later.ros_ns + round(sign * age * S), "view", later)
        assert world.state == state
        world.server.on_inference_failed(world.inferences[-1][0] if world.inferences else 0, "again")
        world.say()


def test_what_was_seen_while_the_scene_settled_does_not_count() -> None:
    world = thinking(settle=0.25)
    world.think()
    world.accept()
    rest = world.now.ros_ns
    world.end()
    world.server.on_observation(rest + S // 4 - 1, "it shakes", world.now)
    assert world.state == PolicyState.OBSERVING
    world.server.on_observation(rest + S // 4, "it rests", world.now)
    assert world.state == PolicyState.PROPOSING and world.inferences[-1][1] == "it rests"


@pytest.mark.parametrize(("age", "success"), [(59.5, True), (61.25, False)])
def test_a_proposal_may_be_as_old_as_the_limit(age: float, success: bool) -> None:
    world = thinking(require_approval=True)
    world.think()
    seen = world.proposals[-1].stamp_ns
    answer = world.server.approve(world.statuses[-1].proposal_id, Moment(world.now.wall, seen + round(age * S)))
    assert answer.success == success and len(world.goals) == success
    if not success:
        assert answer.message == "the proposal is 61 s old: a new one follows"
        assert world.message == "the proposal is 61 s old, looking again"


@pytest.mark.parametrize(
    ("wait", "state", "said"),
    [
        (2.999, PolicyState.OBSERVING, "waiting for a fresh heightmap"),
        (3.0, PolicyState.FAILED, "no fresh heightmap for 3.0 s: is the camera running? (topic /cliport/heightmap)"),
    ],
)
def test_the_camera_is_waited_for_to_the_last_moment(wait: float, state: PolicyState, said: str) -> None:
    world = World()
    world.say()
    world.server.tick(Moment(world.now.wall + wait, world.now.ros_ns))
    assert (world.state, world.message) == (state, said)


def test_what_perception_refuses_the_camera_for_is_said_until_it_sees_again() -> None:
    said = []
    for seen_later in (False, True):
        world = World()
        world.server.on_complaint("perception refuses\nthe camera's data", world.now.ros_ns)
        if seen_later:
            world.server.on_observation(world.now.ros_ns + 1, "it sees again", world.now)
        later = Moment(world.now.wall + 1.0, world.now.ros_ns + 90 * S)
        world.server.on_instruction("put the red block in the bowl", later)
        world.server.tick(Moment(later.wall + 3.0, later.ros_ns))
        assert world.state == PolicyState.FAILED
        said.append(world.message)
    assert said[0] == "no fresh heightmap for 3.0 s: perception refuses the camera's data"
    assert said[1].startswith("no fresh heightmap for 3.0 s: is the camera running?")


@pytest.mark.parametrize(("wait", "state"), [(29.9, PolicyState.PROPOSING), (30.0, PolicyState.FAILED)])
def test_the_policy_is_waited_for_to_the_last_moment(wait: float, state: PolicyState) -> None:
    world = thinking()
    world.server.tick(Moment(world.now.wall + wait, world.now.ros_ns))
    assert world.state == state


def test_time_to_see_begins_when_the_cancelled_motion_has_ended() -> None:
    world = World(observation_timeout=3.0, cancel_timeout=5.0)
    world.start_moving()
    world.say()
    world.wait(4.0)
    assert world.state == PolicyState.OBSERVING
    world.end(Outcome.CANCELLED)
    world.wait(2.9)
    assert world.state == PolicyState.OBSERVING
    world.wait(0.2)
    assert world.state == PolicyState.FAILED


@pytest.mark.parametrize(("back", "state"), [(9, PolicyState.OBSERVING), (11, PolicyState.PROPOSING)])
def test_a_clock_that_was_set_back_by_ten_seconds_begins_anew(back: int, state: PolicyState) -> None:
    world = World(settle=0.0, observation_timeout=60.0)
    world.say()
    earlier = Moment(world.now.wall + 1.0, world.now.ros_ns - back * S)
    world.server.on_observation(earlier.ros_ns, "view", earlier)
    assert world.state == state


def test_a_server_that_was_not_stopped_says_nothing_when_it_is_resumed() -> None:
    world = World()
    world.server.announce()
    assert world.server.resume() == (True, "ready for an instruction") and len(world.statuses) == 1
    assert world.statuses == [ServerStatus(PolicyState.IDLE, "ready", "")]
    world.server.stop(world.now)
    assert world.message == "stopped: call /cliport/resume to go on" and world.state == PolicyState.IDLE


def test_a_missed_object_is_not_tried_again_where_no_retry_is_allowed() -> None:
    world = World(retries=0)
    world.say()
    world.act(Outcome.GRASP_MISSED)
    assert (world.state, world.message) == (PolicyState.FAILED, "executor: GRASP_MISSED")


@pytest.mark.parametrize("text", ["", "stop"])
def test_stopping_what_does_nothing_says_so(text: str) -> None:
    world = World()
    world.say(text)
    said = "'stop'" if text else "empty"
    assert (world.state, world.message) == (PolicyState.IDLE, f"nothing to do: the instruction is {said}")
    assert world.server.status.step == 0


def test_a_new_instruction_counts_its_own_steps_and_misses() -> None:
    world = World(retries=1)
    world.say()
    world.act(Outcome.GRASP_MISSED)
    world.say()
    assert world.server.status.step == 0
    world.act(Outcome.GRASP_MISSED)
    assert world.message == "grasp missed, trying again (1 of 1)"
