"""From an instruction to the goal: what is looked at, how often is tried, what ends it."""

from __future__ import annotations

import pytest
from server_world import GOAL, S, World

from cliport_core.outcome import Outcome
from cliport_core.policy_state import PolicyState
from cliport_policy.errors import ConfigError
from cliport_policy.server.types import ServerConfig
from cliport_policy.server.wording import absent_words


@pytest.mark.parametrize(("look_back", "state"), [(0.0, PolicyState.OBSERVING), (1.0, PolicyState.PROPOSING)])
def test_a_replay_may_look_at_what_was_seen_before_the_instruction(look_back: float, state: PolicyState) -> None:
    world = World(look_back=look_back)
    world.see()
    world.wait(0.4)
    world.say()
    assert world.state == state
    with pytest.raises(ConfigError, match="look_back"):
        ServerConfig(look_back=-1.0)


def test_a_goal_is_reached_step_by_step() -> None:
    world = World()
    world.server.announce()
    assert world.statuses[0].state == PolicyState.IDLE
    world.say()
    for _ in range(3):
        world.act()
    world.see()
    world.think(done=0.9)
    assert (world.state, world.message) == (PolicyState.DONE, "the goal looks reached after 3 steps")
    assert len(world.goals) == len(world.proposals) == 3
    assert {goal.instruction for _, goal in world.goals} == {GOAL}
    states = [status.state for status in world.statuses]
    cycle = [PolicyState.OBSERVING, PolicyState.PROPOSING, PolicyState.EXECUTING]
    assert states == [PolicyState.IDLE, *cycle * 3, *cycle[:2], PolicyState.DONE]
    assert [s.step for s in world.statuses if s.state == PolicyState.EXECUTING] == [1, 2, 3]


def test_a_goal_already_reached_moves_nothing() -> None:
    world = World()
    world.say()
    world.see()
    world.think(done=0.8)
    assert (world.state, world.message) == (PolicyState.DONE, "the goal looks reached already")
    assert not world.goals


def test_only_what_was_seen_after_the_last_motion_counts() -> None:
    world = World(settle=0.2)
    world.see()
    world.wait(0.1)
    world.say()
    world.server.on_observation(world.now.ros_ns - S // 2, "before the instruction", world.now)
    assert not world.inferences
    world.act()
    world.server.on_observation(world.now.ros_ns - S // 10, "the arm still moved", world.now)
    world.server.on_observation(world.now.ros_ns + S // 10, "the scene still shook", world.now)
    assert len(world.inferences) == 1
    world.see()
    assert len(world.inferences) == 2
    assert world.proposals[0].stamp_ns < world.now.ros_ns


def test_old_heightmaps_do_not_count() -> None:
    world = World(max_observation_age=1.0, observation_timeout=10.0)
    world.say()
    world.see(age_s=1.5, wait_s=3.0)
    assert world.state == PolicyState.OBSERVING


def test_a_silent_camera_ends_it() -> None:
    world = World()
    world.say()
    world.wait(2.9)
    assert world.state == PolicyState.OBSERVING
    world.wait(0.2)
    assert world.state == PolicyState.FAILED
    assert world.message == ("no fresh heightmap for 3.0 s: is the camera running? (topic /cliport/heightmap)")
    world.see()
    assert not world.inferences


def test_the_step_limit_ends_it() -> None:
    world = World(max_steps=2)
    world.say()
    world.act()
    world.act()
    world.see()
    world.think()
    assert (world.state, world.message) == (PolicyState.FAILED, "step limit of 2 reached")
    assert len(world.goals) == 2


@pytest.mark.parametrize("outcome", [Outcome.GRASP_MISSED, Outcome.DROPPED])
def test_a_lost_object_is_tried_again_and_not_for_ever(outcome: Outcome) -> None:
    world = World(retries=2)
    world.say()
    world.act(outcome)
    assert world.state == PolicyState.OBSERVING
    assert "trying again (1 of 2)" in world.message
    world.act()  # success: the count starts afresh
    world.act(outcome)
    world.act(outcome)
    assert "trying again (2 of 2)" in world.message
    world.act(outcome, "closed at 0 mm")
    assert (world.state, world.message) == (PolicyState.FAILED, f"executor: {outcome.name}: closed at 0 mm")


@pytest.mark.parametrize(
    "outcome",
    [Outcome.REJECTED, Outcome.PLANNING_FAILED, Outcome.EXECUTION_FAILED,
     Outcome.CANCELLED, Outcome.PLANNED],
)  # fmt: skip
def test_other_outcomes_fail_with_the_executors_words(outcome: Outcome) -> None:
    world = World()
    world.say()
    world.act(outcome, "the place is\nout of reach")
    assert world.state == PolicyState.FAILED
    assert world.message == f"executor: {outcome.name}: the place is out of reach"


def test_phases_are_passed_on_once_each() -> None:
    world = World()
    world.start_moving()
    token = world.goals[-1][0]
    for phase in ("DESCEND", "DESCEND", "CLOSE"):
        world.server.on_feedback(token, phase, world.now)
    world.server.on_feedback(token - 1, "OPEN", world.now)
    assert [s.message for s in world.statuses[-2:]] == ["step 1: DESCEND", "step 1: CLOSE"]


def test_what_is_not_there_is_not_taken_for_done() -> None:
    world = World()
    world.say("put the purple blocks in a red bowl")
    world.see()
    world.think(absent=0.8, done=0.1)
    assert world.state == PolicyState.FAILED and not world.goals
    assert world.message == "what 'put the purple blocks in a red bowl' names is not to be seen"
    world.say("put the purple blocks in a red bowl")
    world.see()
    world.think(absent=0.9, missing="purple block")
    assert world.state == PolicyState.FAILED and world.message == "no purple block is to be seen"


@pytest.mark.parametrize(
    ("instruction", "missing"),
    [
        ("Put it on the STAND.", "stand"),
        ("empty all the boxes", "box"),
        ("empty the bowls", "red or blue bowl"),
        ("put it in the red dish", "red or blue bowl"),  # named by its colour
    ],
)
def test_what_is_named_and_not_there_is_said(instruction: str, missing: str) -> None:
    assert absent_words(instruction, missing) == f"no {missing} is to be seen"


@pytest.mark.parametrize(
    ("instruction", "missing", "thing"),
    [
        ("pick up the gray block", "stand", "a stand"),
        ("clean up this or that", "orange or blue bowl", "an orange or blue bowl"),
    ],
)
def test_what_the_policy_guessed_is_called_a_guess(instruction: str, missing: str, thing: str) -> None:
    guess = f"'{instruction}' was taken to name {thing}, and none is to be seen: say what to pick and where to put it"
    assert absent_words(instruction, missing) == guess


@pytest.mark.parametrize("text", ["stop", "Halt!", "cancel, please", "STOP NOW", "please stop it.", "stop the arm"])
def test_words_that_mean_stop_end_what_is_going_on(text: str) -> None:
    world = World()
    world.start_moving()
    world.say(text)
    assert world.state == PolicyState.IDLE and len(world.cancelled) == 1
    assert world.message == f"stopped by the instruction '{text}'"


def test_a_sentence_that_is_refused_says_that_it_stopped_what_went_on() -> None:
    world = World()
    world.say("sing")
    assert world.message == "the instruction 'sing' is not understood"
    world.start_moving()
    world.say("sing")
    words = "what went on was stopped: the instruction 'sing' is not understood"
    assert len(world.cancelled) == 1 and world.message == words


@pytest.mark.parametrize("text", ["please", "it", "!", "the robot"])
def test_words_that_only_stand_beside_stop_do_not_mean_it(text: str) -> None:
    world = World()
    world.say(text)
    assert (world.state, world.message) == (PolicyState.FAILED, f"the instruction '{text}' is not understood")


@pytest.mark.parametrize("text", ["stop the red block in the bowl", "put the red stop blocks in a bowl"])
def test_a_sentence_that_holds_such_a_word_is_a_sentence(text: str) -> None:
    world = World()
    world.say(text)
    assert world.state == PolicyState.OBSERVING
