"""Every path of the policy server's state machine, with a fake executor, policy and clock."""

from __future__ import annotations

from typing import Any

import pytest

from cliport_perception.policy_state import PolicyState
from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome
from cliport_policy.action import PickPlaceAction
from cliport_policy.errors import ConfigError, InstructionError
from cliport_policy.server.logic import PolicyServer
from cliport_policy.server.types import Answer, Moment, Proposal, ServerConfig, ServerStatus

S = 1_000_000_000
GOAL = "put the red blocks in the green bowl"


def action(done: float = 0.0, confidence: float = 0.9) -> PickPlaceAction:
    pose = PlanarPose(0.4, 0.1, 0.3)
    return PickPlaceAction(pose, pose, (200, 60), (200, 60), confidence, confidence, done)


class World:
    """Fakes of all ports, and a server on two clocks that `wait` moves."""

    def __init__(self, **settings: Any) -> None:
        self.now = Moment(100.0, 5000 * S)
        self.ready = True
        self.statuses: list[ServerStatus] = []
        self.proposals: list[Proposal] = []
        self.inferences: list[tuple[int, Any, str]] = []
        self.goals: list[tuple[int, Proposal, str]] = []
        self.cancelled: list[int] = []
        self.stops = self.resumes = 0
        self.server = PolicyServer(ServerConfig(**settings), self, self.check_instruction, self)

    # effects

    def publish_status(self, status: ServerStatus) -> None:
        self.statuses.append(status)

    def publish_proposal(self, proposal: Proposal) -> None:
        self.proposals.append(proposal)

    def start_inference(self, token: int, observation: Any, instruction: str) -> None:
        self.inferences.append((token, observation, instruction))

    def check_instruction(self, instruction: str) -> None:
        if "block" not in instruction:
            raise InstructionError(f"the instruction '{instruction}' is not understood")

    # executor

    def is_ready(self) -> bool:
        return self.ready

    def send(self, token: int, proposal: Proposal, instruction: str) -> None:
        self.goals.append((token, proposal, instruction))

    def cancel(self, token: int) -> None:
        self.cancelled.append(token)

    def stop(self) -> None:
        self.stops += 1

    def resume(self) -> None:
        self.resumes += 1

    # events

    @property
    def state(self) -> PolicyState:
        return self.server.status.state

    @property
    def message(self) -> str:
        return self.server.status.message

    def wait(self, seconds: float, heartbeat: bool = True) -> None:
        for _ in range(max(1, round(seconds / 0.05))):
            self.now = Moment(self.now.wall + 0.05, self.now.ros_ns + S // 20)
            if heartbeat:
                self.server.on_heartbeat(self.now)
            self.server.tick(self.now)

    def say(self, text: str = GOAL) -> None:
        self.server.on_instruction(text, self.now)

    def see(self, age_s: float = 0.0, wait_s: float = 0.3) -> None:
        self.wait(wait_s)
        self.server.on_observation(self.now.ros_ns - int(age_s * S), f"view {self.now.wall:.2f}", self.now)

    def think(self, **answer: float) -> None:
        self.server.on_proposal(self.inferences[-1][0], action(**answer), self.now)

    def accept(self) -> None:
        self.server.on_goal_response(self.goals[-1][0], True, self.now)

    def end(self, outcome: Outcome = Outcome.SUCCEEDED, message: str = "") -> None:
        self.server.on_result(self.goals[-1][0], outcome, message, self.now)

    def act(self, outcome: Outcome = Outcome.SUCCEEDED, message: str = "") -> None:
        """One whole step: see, think, move."""
        self.see()
        self.think()
        self.accept()
        self.wait(1.0)
        self.end(outcome, message)

    def start_moving(self) -> None:
        self.say()
        self.see()
        self.think()
        self.accept()
        assert self.state == PolicyState.EXECUTING


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
    assert {goal[2] for goal in world.goals} == {GOAL}
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
    [("x" * 1_000_000, "1000000 characters"), ("block " * 200, "1200 characters"),
     ("fnord", "not understood"), ("\x1b[31m\nboo\x00", "not understood")],
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
    world.server.on_proposal(world.inferences[0][0], action(), world.now)
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
    assert world.server.approve(world.now) == Answer(False, "nothing waits for approval: the server is IDLE")
    world.say()
    world.see()
    world.think()
    assert world.state == PolicyState.WAITING_FOR_APPROVAL
    assert world.proposals
    assert [status.confidence for status in world.statuses] == [0.0, 0.0, 0.9]  # known when it waits
    world.wait(20.0)
    assert not world.goals
    assert world.server.approve(world.now).success
    assert len(world.goals) == 1
    assert not world.server.approve(world.now).success


def test_an_old_proposal_is_made_again_instead_of_executed() -> None:
    world = World(require_approval=True, max_proposal_age=30.0)
    world.say()
    world.see()
    world.think()
    world.wait(31.0)
    assert not world.server.approve(world.now).success
    assert world.state == PolicyState.OBSERVING
    assert not world.goals
    world.see()
    world.think()
    assert world.server.approve(world.now).success


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
    "settings", [{"max_steps": 0}, {"done_threshold": 1.5}, {"goal_timeout": 0.0}, {"retries": -1}]
)
def test_senseless_settings_are_refused(settings: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        ServerConfig(**settings)
