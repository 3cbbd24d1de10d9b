"""What goes wrong around the policy server: policy, executor, time, settings."""

from __future__ import annotations

from typing import Any

import pytest
from server_world import S, World

from cliport_core.policy_state import PolicyState
from cliport_policy.errors import ConfigError
from cliport_policy.server.types import Moment, ServerConfig


def test_an_unsure_policy_moves_nothing() -> None:
    world = World(min_confidence=0.05)
    world.say()
    world.see()
    world.think(confidence=0.03)
    assert world.state == PolicyState.FAILED
    assert "not sure enough" in world.message
    assert not world.goals


def test_a_policy_that_fails_or_hangs_is_reported() -> None:
    world = World(inference_timeout=30.0)
    world.say()
    world.see()
    world.server.on_inference_failed(world.inferences[-1][0], "the observation's workspace is another")
    assert (world.state, world.message) == (
        PolicyState.FAILED,
        "the observation's workspace is another",
    )
    world.say()
    world.see()
    world.wait(30.1)
    assert (world.state, world.message) == (
        PolicyState.FAILED,
        "the policy gave no answer within 30 s",
    )
    world.think()
    assert not world.goals


def test_an_executor_that_starts_late_is_waited_for() -> None:
    world = World(executor_timeout=5.0)
    world.ready = False
    world.say()
    world.see()
    world.think()
    world.wait(2.0)
    assert not world.goals
    world.ready = True
    world.wait(0.1)
    assert len(world.goals) == 1


@pytest.mark.parametrize(("ready", "words"), [(False, "not there"), (True, "not answering")])
def test_an_executor_that_is_missing_or_mute_is_reported(ready: bool, words: str) -> None:
    world = World(executor_timeout=5.0)
    world.ready = ready
    world.say()
    world.see()
    world.think()
    world.wait(5.1)
    assert world.state == PolicyState.FAILED
    assert world.message.startswith(f"the executor is {words}")


def test_a_refused_goal_is_reported() -> None:
    world = World()
    world.say()
    world.see()
    world.think()
    world.server.on_goal_response(world.goals[-1][0], False, world.now)
    assert (world.state, world.message) == (
        PolicyState.FAILED,
        "the executor refused the goal: is it busy or stopped?",
    )


def test_a_missing_heartbeat_is_an_executor_lost() -> None:
    world = World(heartbeat_timeout=0.5)
    world.start_moving()
    world.server.on_feedback(world.goals[-1][0], "CARRY", world.now)
    world.wait(10.0)
    assert world.state == PolicyState.EXECUTING
    world.wait(0.6, heartbeat=False)
    assert (world.state, world.message) == (
        PolicyState.FAILED,
        "executor lost: no heartbeat for 0.5 s during CARRY",
    )
    assert world.cancelled == [world.goals[-1][0]]
    world.end()
    assert world.state == PolicyState.FAILED


def test_an_action_server_that_disappears_is_an_executor_lost() -> None:
    world = World()
    world.start_moving()
    world.ready = False
    world.wait(0.1)
    assert world.state == PolicyState.FAILED
    assert world.message == "executor lost: its action server is gone during the start"


def test_an_executor_without_heartbeat_is_not_lost() -> None:
    world = World()
    world.say()
    world.now = Moment(world.now.wall + 0.1, world.now.ros_ns + S // 10)
    world.server.on_observation(world.now.ros_ns, "view", world.now)
    world.think()
    world.accept()
    world.wait(10.0, heartbeat=False)
    assert world.state == PolicyState.EXECUTING


def test_our_own_pause_is_not_blamed_on_the_executor() -> None:
    world = World(heartbeat_timeout=0.5)
    world.start_moving()
    world.wait(0.5)
    world.now = Moment(world.now.wall + 2.0, world.now.ros_ns + 2 * S)
    world.server.tick(world.now)
    assert world.state == PolicyState.EXECUTING
    world.wait(0.6, heartbeat=False)
    assert world.state == PolicyState.FAILED


def test_a_motion_without_end_is_cancelled() -> None:
    world = World(goal_timeout=60.0)
    world.start_moving()
    world.wait(60.1)
    assert (world.state, world.message) == (
        PolicyState.FAILED,
        "the executor was not done after 60 s: cancelled",
    )
    assert world.cancelled == [world.goals[-1][0]]


def test_simulated_time_may_stand_still_or_start_afresh() -> None:
    world = World()
    world.say()
    wall = world.now.wall
    for i in range(80):  # 4 s of wall time without ROS time
        world.server.tick(Moment(wall + i * 0.05, world.now.ros_ns))
    assert world.state == PolicyState.FAILED
    world.now = Moment(wall + 5.0, 3 * S)  # the simulator was restarted
    world.say()
    world.see()
    assert world.state == PolicyState.PROPOSING


@pytest.mark.parametrize(
    "settings",
    [{"max_steps": 0}, {"done_threshold": 1.5}, {"goal_timeout": 0.0}, {"retries": -1}, {"settle": -5.0},
     {"settle": float("nan")}, {"settle": float("inf")}, {"look_back": -1.0}, {"look_back": float("inf")}],
)  # fmt: skip
def test_senseless_settings_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        ServerConfig(**settings)


def test_a_goal_that_is_taken_after_it_was_given_up_is_cancelled() -> None:
    """It used to run on with nobody's care."""
    world = World()
    world.say()
    world.see()
    world.think()
    token = world.goals[-1][0]
    world.wait(5.1)
    assert world.state == PolicyState.FAILED
    world.server.on_goal_response(token, True, world.now)
    assert world.cancelled == [token]


def test_a_stop_that_did_not_reach_the_executor_says_so() -> None:
    world = World()
    world.ready = False
    answer = world.server.stop(world.now)
    assert not answer.success
    assert "the arm was not told" in answer.message and "\n" not in answer.message
    assert world.message == answer.message


def test_a_resume_that_did_not_reach_the_executor_says_so() -> None:
    world = World()
    world.server.stop(world.now)
    world.ready = False
    answer = world.server.resume()
    assert not answer.success and "/panda_executor/resume is not there" in answer.message
    assert (world.state, world.message) == (PolicyState.IDLE, "ready")
    world.ready = True
    assert world.server.resume().success
