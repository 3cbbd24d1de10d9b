"""What people say to the policy server: instructions, stop, approval."""

from __future__ import annotations

import pytest
from server_world import World, inference

from cliport_core.outcome import Outcome
from cliport_core.policy_state import PolicyState
from cliport_policy.server.types import Answer


@pytest.mark.parametrize("text", ["", "   ", "\n\t"])
def test_an_empty_instruction_stops_the_current_goal(text: str) -> None:
    world = World()
    world.start_moving()
    world.say(text)
    assert (world.state, world.message) == (PolicyState.IDLE, "stopped by an empty instruction")
    assert world.cancelled == [world.goals[-1][0]]
    world.end(Outcome.CANCELLED)
    assert world.state == PolicyState.IDLE
    world.say()  # not latching
    world.see()
    assert world.state == PolicyState.PROPOSING


def test_an_empty_instruction_when_idle_does_nothing() -> None:
    world = World()
    world.say("")
    assert world.state == PolicyState.IDLE
    assert not world.cancelled


@pytest.mark.parametrize(
    ("text", "words"),
    [("x" * 1_000_000, "1000000 characters"), ("block " * 200, "1199 characters"),
     ("fnord", "not understood"), ("\x1b[31m\nboo\x00", "U+001B")],
)  # fmt: skip
def test_what_cannot_be_acted_on_fails_in_one_short_line(text: str, words: str) -> None:
    world = World()
    world.say(text)
    assert world.state == PolicyState.FAILED
    assert words in world.message
    for line in (world.message, world.server.status.instruction):
        assert line.isprintable()
        assert len(line) < 200
    world.see()
    assert not world.inferences
    assert not world.goals


@pytest.mark.parametrize(("length", "end"), [(60, ""), (61, "...")])
def test_what_is_no_instruction_is_shown_up_to_its_sixtieth_character(length: int, end: str) -> None:
    world = World()
    world.say("no\x1b" + "x" * (length - 3))
    assert world.server.status.instruction == "no " + "x" * 57 + end


def test_a_new_instruction_replaces_the_old_after_its_motion_has_ended() -> None:
    world = World()
    world.start_moving()
    world.say("put the blue block in the yellow bowl")
    assert world.cancelled == [world.goals[-1][0]]
    world.see()
    assert world.state == PolicyState.OBSERVING
    assert len(world.inferences) == 1
    world.end(Outcome.CANCELLED)
    world.see()
    assert world.inferences[-1][2] == "put the blue block in the yellow bowl"
    world.think()
    world.accept()
    world.end()
    assert world.server.status.step == 1
    assert world.state == PolicyState.OBSERVING


def test_the_old_proposal_is_not_executed_for_the_new_instruction() -> None:
    world = World()
    world.say()
    world.see()
    world.wait(0.1)
    world.say("put the blue block in the yellow bowl")
    world.server.on_proposal(world.inferences[0][0], inference(), world.now)
    assert not world.goals
    world.server.on_inference_failed(world.inferences[0][0], "late")
    assert world.state == PolicyState.OBSERVING


def test_a_cancel_before_the_executor_answered_is_repeated() -> None:
    world = World()
    world.say()
    world.see()
    world.think()
    world.say("")
    world.accept()
    assert world.cancelled == [world.goals[-1][0]] * 2


def test_a_cancel_that_nobody_confirms_is_an_executor_lost() -> None:
    world = World(cancel_timeout=5.0)
    world.start_moving()
    world.say()
    world.wait(5.1)
    assert world.state == PolicyState.FAILED
    assert world.message.startswith("executor lost: no answer to a cancel")
    world.say()
    world.see()
    world.think()
    assert len(world.goals) == 2


def test_stop_latches_and_resume_ends_it() -> None:
    world = World()
    world.start_moving()
    assert world.server.stop(world.now).success
    assert (world.stops, world.cancelled) == (1, [world.goals[-1][0]])
    assert world.state == PolicyState.IDLE
    assert "stopped" in world.message
    world.end(Outcome.CANCELLED)
    world.say()
    assert (world.state, world.message) == (
        PolicyState.FAILED,
        "the server is stopped: call /cliport/resume first",
    )
    assert world.server.resume().success
    assert (world.resumes, world.state, world.message) == (1, PolicyState.IDLE, "ready")
    world.say()
    world.see()
    world.think()
    assert len(world.goals) == 2


def test_stop_while_thinking_moves_nothing() -> None:
    world = World()
    world.say()
    world.see()
    world.server.stop(world.now)
    world.think()
    assert not world.goals
    assert world.state == PolicyState.IDLE


def test_approval_comes_before_every_motion() -> None:
    world = World(require_approval=True)
    assert world.agree() == Answer(False, "nothing waits for approval: the server is IDLE")
    world.say()
    world.see()
    world.think()
    assert world.state == PolicyState.WAITING_FOR_APPROVAL
    assert world.proposals
    assert [status.confidence for status in world.statuses] == [None, None, 0.9]  # known when it waits
    world.wait(20.0)
    assert not world.goals
    assert world.agree().success
    assert len(world.goals) == 1
    assert not world.agree().success


def test_a_proposal_is_approved_by_its_id_alone() -> None:
    world = World(require_approval=True)
    world.say()
    world.see()
    world.think()
    first = world.statuses[-1].proposal_id
    assert len(first) == 8 and first in world.statuses[-1].message
    for other in ("", "12345678"):
        refused = world.server.approve(other, world.now)
        assert not refused.success and f"the proposal that waits is {first}, not" in refused.message
    world.say()  # anew: what was seen of the first proposal says nothing of the second
    world.see()
    world.think()
    second = world.statuses[-1].proposal_id
    assert second != first and not world.server.approve(first, world.now).success
    assert not world.goals
    assert world.server.approve(second, world.now).success
    assert len(world.goals) == 1 and world.statuses[-1].proposal_id == ""


def test_nothing_is_taken_while_another_policy_is_loaded() -> None:
    world = World()
    world.say()
    assert world.server.hold("loading the policy mine") == Answer(False, "the server is OBSERVING: end that first")
    world.say("")
    assert world.server.hold("loading the policy mine") == Answer(True, "loading the policy mine")
    assert (world.state, world.message) == (PolicyState.IDLE, "loading the policy mine")
    assert world.server.hold("loading the policy yours") == Answer(False, "loading the policy mine")
    world.say()
    world.see()
    assert (world.state, world.message) == (PolicyState.FAILED, "loading the policy mine")
    assert not world.inferences
    world.server.release("the policy mine is loaded")
    assert (world.state, world.message) == (PolicyState.IDLE, "the policy mine is loaded")
    world.say()
    world.see()
    assert world.state == PolicyState.PROPOSING


def test_a_stop_while_a_policy_is_loaded_is_still_said() -> None:
    world = World()
    world.server.hold("loading the policy mine")
    world.server.stop(world.now)
    world.server.resume()
    assert (world.state, world.message) == (PolicyState.IDLE, "loading the policy mine"), "it is not ready yet"
    world.server.stop(world.now)
    world.server.release("the policy mine is loaded")
    assert world.message == "the policy mine is loaded; stopped: call /cliport/resume to go on"
    world.say()
    assert (world.state, world.message) == (PolicyState.FAILED, "the server is stopped: call /cliport/resume first")


def test_no_policy_is_loaded_before_a_cancelled_motion_has_ended() -> None:
    world = World()
    world.start_moving()
    world.say("")
    assert world.server.hold("loading") == Answer(
        False, "the motion that was cancelled has not ended yet: try again then"
    )
    world.end(Outcome.CANCELLED)
    assert world.server.hold("loading").success


def test_the_executors_plan_is_approved_through_the_server() -> None:
    world = World()
    world.start_moving()
    token = world.goals[-1][0]
    assert world.agree() == Answer(False, "nothing waits for approval: the server is EXECUTING")
    world.server.on_feedback(token, "APPROVAL", world.now, "1a2b3c4d")
    assert world.statuses[-1].proposal_id == "1a2b3c4d" and "1a2b3c4d waits for a call of" in world.message
    assert "the plan that waits is 1a2b3c4d" in world.server.approve("", world.now).message
    assert not world.approved
    world.ready = False
    assert world.agree() == Answer(False, "/panda_executor/approve is not there")
    world.ready, world.approved = True, []
    assert world.agree() == Answer(True, "the executor is told")
    assert world.approved == ["1a2b3c4d"]
    world.server.on_feedback(token, "DESCEND", world.now)
    assert (world.state, world.statuses[-1].proposal_id) == (PolicyState.EXECUTING, "")
    assert not world.server.approve("1a2b3c4d", world.now).success


def test_an_old_proposal_is_made_again_instead_of_executed() -> None:
    world = World(require_approval=True, max_proposal_age=30.0)
    world.say()
    world.see()
    world.think()
    world.wait(31.0)
    assert not world.agree().success
    assert world.state == PolicyState.OBSERVING
    assert not world.goals
    world.see()
    world.think()
    assert world.agree().success
