"""What the policy server does when: a state machine that knows neither ROS nor networks.

Events come in as method calls with the moment they happened; effects go out through `ServerEffects`.
"""

from __future__ import annotations

from enum import Enum
from typing import Any

from cliport_policy.action import PickPlaceAction
from cliport_policy.errors import PolicyError
from cliport_policy.server_types import (
    BUSY,
    TRY_AGAIN,
    Answer,
    ExecutionOutcome,
    Moment,
    Proposal,
    ServerConfig,
    ServerEffects,
    ServerState,
    ServerStatus,
)

MAX_INSTRUCTION_LENGTH = 1000
_STALL = 0.2  # a longer pause between ticks was our own; the executor is not to blame for it [s]


class _GoalPhase(Enum):
    """Where the goal at the executor is."""

    NONE = "none"
    WAITING = "for the executor to appear"
    SENT = "for the executor's answer"
    ACCEPTED = "for the result"
    CANCELLING = "for the cancel to be confirmed"


class PolicyServer:
    """Drives the executor from an instruction until the goal is reached, a limit ends it, or it is stopped."""

    def __init__(self, config: ServerConfig, effects: ServerEffects) -> None:
        self.config = config
        self._effects = effects
        self._status = ServerStatus(ServerState.IDLE, "ready", "", 0)
        self._stopped = False
        self._token = 0
        self._deadline: float | None = None  # of the current state, wall clock
        self._earliest_ns = 0  # observations taken before this show the past
        self._latest: tuple[int, Any] | None = None  # (stamp_ns, observation)
        self._observed_ns = 0  # stamp of the observation being worked on
        self._proposal: Proposal | None = None
        self._misses = 0
        self._goal = _GoalPhase.NONE
        self._goal_token = -1
        self._goal_deadline = 0.0
        self._heartbeat: float | None = None
        self._last_tick: float | None = None
        self._executor_phase = ""

    @property
    def status(self) -> ServerStatus:
        """The current one, as last published."""
        return self._status

    def announce(self) -> None:
        """Publish the status as it is (at start)."""
        self._effects.publish_status(self._status)

    # what people ask for

    def on_instruction(self, text: str, now: Moment) -> None:
        """A new goal; an empty one stops the current. A busy server drops what it was doing."""
        was_busy = self._status.state in BUSY
        self._abandon(now)
        instruction = _one_line(text[: MAX_INSTRUCTION_LENGTH + 1])
        if not instruction and len(text) <= MAX_INSTRUCTION_LENGTH:
            self._enter(ServerState.IDLE, "stopped by an empty instruction" if was_busy else "ready")
            return
        shown = instruction if len(text) <= MAX_INSTRUCTION_LENGTH else instruction[:60] + "..."
        self._status = ServerStatus(self._status.state, "", shown, 0)
        if len(text) > MAX_INSTRUCTION_LENGTH:
            self._fail(f"the instruction has {len(text)} characters: at most {MAX_INSTRUCTION_LENGTH} are read")
            return
        if self._stopped:
            self._fail("the server is stopped: call /cliport/resume first")
            return
        try:
            self._effects.check_instruction(instruction)
        except PolicyError as error:
            self._fail(str(error))
            return
        self._misses = 0
        self._earliest_ns = max(self._earliest_ns, now.ros_ns)  # the scene may just have been rearranged
        self._observe("waiting for a fresh heightmap", now)

    def approve(self, now: Moment) -> Answer:
        """A person agrees to the proposal."""
        if self._status.state != ServerState.WAITING_FOR_APPROVAL or self._proposal is None:
            return Answer(False, f"nothing waits for approval (the server is {self._status.state.name})")
        age = (now.ros_ns - self._proposal.stamp_ns) * 1e-9
        if age > self.config.max_proposal_age:
            self._observe(f"the proposal is {age:.0f} s old: looking again", now)
            return Answer(False, f"the proposal is {age:.0f} s old; a new one follows")
        self._execute(now)
        return Answer(True, "approved")

    def stop(self, now: Moment) -> Answer:
        """Latching: nothing moves before `resume`."""
        self._stopped = True
        self._effects.stop_executor()
        self._abandon(now)
        self._enter(ServerState.IDLE, "stopped: call /cliport/resume to go on")
        return Answer(True, "stopped; call /cliport/resume to go on")

    def resume(self) -> Answer:
        """Ends a stop; the next instruction is acted on again."""
        was_stopped, self._stopped = self._stopped, False
        self._effects.resume_executor()
        if was_stopped:
            self._enter(ServerState.IDLE, "ready")
        return Answer(True, "ready for an instruction")

    # what the camera and the policy say

    def on_observation(self, stamp_ns: int, observation: Any, now: Moment) -> None:
        """A heightmap came; stamp_ns is when its images were taken."""
        self._latest = stamp_ns, observation
        self._use_observation(now)

    def on_proposal(self, token: int, action: PickPlaceAction, now: Moment) -> None:
        """The policy answered."""
        if token != self._token or self._status.state != ServerState.PROPOSING:
            return
        config, step = self.config, self._status.step
        sure = min(action.pick_confidence, action.place_confidence)
        if action.done_probability >= config.done_threshold:
            message = (
                f"the goal looks reached after {step} steps" if step else "the goal looks reached already"
            )
            self._enter(ServerState.DONE, message)
        elif step >= config.max_steps:
            self._fail(f"step limit of {config.max_steps} reached")
        elif sure < config.min_confidence:
            self._fail(
                f"not sure enough where to act (pick {action.pick_confidence:.2f}, place "
                f"{action.place_confidence:.2f}, at least {config.min_confidence:.2f} needed)"
            )
        else:
            self._proposal = Proposal(action, self._observed_ns)
            self._effects.publish_proposal(self._proposal)
            if config.require_approval:
                self._enter(ServerState.WAITING_FOR_APPROVAL, "waiting for a call of /cliport/approve")
            else:
                self._execute(now)

    def on_inference_failed(self, token: int, message: str) -> None:
        """The policy could not answer."""
        if token == self._token and self._status.state == ServerState.PROPOSING:
            self._fail(message)

    # what the executor says

    def on_heartbeat(self, now: Moment) -> None:
        """The executor lives."""
        self._heartbeat = now.wall

    def on_goal_response(self, token: int, accepted: bool, now: Moment) -> None:
        """The executor took the goal or not."""
        if token != self._goal_token or self._goal == _GoalPhase.NONE:
            return
        if not accepted:
            self._end_goal(now)
            if self._status.state == ServerState.EXECUTING:
                self._fail("the executor refused the goal: is it busy or stopped?")
        elif self._goal == _GoalPhase.CANCELLING:
            self._effects.cancel_goal(token)  # asked for before there was anything to cancel
        else:
            self._goal, self._goal_deadline = _GoalPhase.ACCEPTED, now.wall + self.config.goal_timeout
            if self._heartbeat is not None:  # an executor that has none is watched by its action server only
                self._heartbeat = now.wall

    def on_feedback(self, token: int, phase: str, now: Moment) -> None:
        """The executor is in a phase."""
        if self._heartbeat is not None:
            self._heartbeat = now.wall
        if token == self._goal_token and self._goal == _GoalPhase.ACCEPTED and phase != self._executor_phase:
            self._executor_phase = phase
            self._enter(ServerState.EXECUTING, f"step {self._status.step}: {phase}")

    def on_result(self, token: int, outcome: ExecutionOutcome, message: str, now: Moment) -> None:
        """The executor is through with a goal."""
        if token != self._goal_token or self._goal == _GoalPhase.NONE:
            return
        wanted = self._goal != _GoalPhase.CANCELLING and self._status.state == ServerState.EXECUTING
        self._end_goal(now)
        if not wanted:
            self._use_observation(now)
        elif outcome == ExecutionOutcome.SUCCEEDED:
            self._misses = 0
            self._observe(f"step {self._status.step} done, looking again", now)
        elif outcome in TRY_AGAIN and self._misses < self.config.retries:
            self._misses += 1
            what = outcome.name.lower().replace("_", " ")
            self._observe(f"{what}, trying again ({self._misses} of {self.config.retries})", now)
        else:
            self._fail(f"executor: {outcome.name}: {message}" if message else f"executor: {outcome.name}")

    # what the clock says

    def tick(self, now: Moment) -> None:
        """Call often (20 Hz): every wait ends here when nothing else ends it."""
        pause = now.wall - self._last_tick if self._last_tick is not None else 0.0
        self._last_tick = now.wall
        if self._heartbeat is not None and pause > _STALL:
            self._heartbeat += pause
        self._watch_goal(now)
        if self._status.state == ServerState.OBSERVING:
            self._use_observation(now)
        if self._deadline is None or now.wall < self._deadline or self._goal == _GoalPhase.CANCELLING:
            return
        if self._status.state == ServerState.OBSERVING:
            self._fail(
                f"no fresh heightmap for {self.config.observation_timeout:.1f} s: is the camera running? "
                "(topic /cliport/heightmap)"
            )
        elif self._status.state == ServerState.PROPOSING:
            self._fail(f"the policy gave no answer within {self.config.inference_timeout:.0f} s")

    def _watch_goal(self, now: Moment) -> None:
        if self._goal == _GoalPhase.NONE:
            return
        if self._goal == _GoalPhase.WAITING and self._effects.executor_is_ready():
            self._send(now)
        elif self._goal == _GoalPhase.ACCEPTED and (reason := self._lost_reason(now)) is not None:
            self._effects.cancel_goal(self._goal_token)
            self._end_goal(now)
            self._fail(f"executor lost: {reason} during {self._executor_phase or 'the first phase'}")
        elif now.wall >= self._goal_deadline:
            self._goal_timed_out(now)

    def _lost_reason(self, now: Moment) -> str | None:
        if not self._effects.executor_is_ready():
            return "its action server is gone"
        if self._heartbeat is not None and now.wall - self._heartbeat > self.config.heartbeat_timeout:
            return f"no heartbeat for {self.config.heartbeat_timeout:.1f} s"
        return None

    def _goal_timed_out(self, now: Moment) -> None:
        phase = self._goal
        if phase == _GoalPhase.ACCEPTED:
            self._cancel_goal(now)
            self._fail(f"the executor was not done after {self.config.goal_timeout:.0f} s: cancelled")
            return
        self._end_goal(now)
        if phase == _GoalPhase.CANCELLING:
            self._fail(f"executor lost: no answer to a cancel for {self.config.cancel_timeout:.1f} s")
        else:
            what = "not there" if phase == _GoalPhase.WAITING else "not answering"
            self._fail(
                f"the executor is {what} ({self.config.executor_timeout:.1f} s): is it running? "
                "(action /panda_executor/pick_place)"
            )

    # transitions

    def _enter(self, state: ServerState, message: str, deadline: float | None = None) -> None:
        self._deadline = deadline
        self._status = self._status._replace(state=state, message=message)
        self._effects.publish_status(self._status)

    def _fail(self, reason: str) -> None:
        self._token += 1
        self._enter(ServerState.FAILED, reason)

    def _abandon(self, now: Moment) -> None:
        """Forget the current instruction; a running motion is cancelled."""
        self._token += 1
        self._proposal = None
        if self._goal == _GoalPhase.WAITING:
            self._goal = _GoalPhase.NONE
        elif self._goal in (_GoalPhase.SENT, _GoalPhase.ACCEPTED):
            self._cancel_goal(now)

    def _cancel_goal(self, now: Moment) -> None:
        self._effects.cancel_goal(self._goal_token)
        self._goal, self._goal_deadline = _GoalPhase.CANCELLING, now.wall + self.config.cancel_timeout

    def _end_goal(self, now: Moment) -> None:
        """The arm rests from now on: only what is seen afterwards counts."""
        self._goal = _GoalPhase.NONE
        self._earliest_ns = now.ros_ns + int(self.config.settle * 1e9)
        if self._status.state == ServerState.OBSERVING:
            self._deadline = now.wall + self.config.observation_timeout

    def _observe(self, message: str, now: Moment) -> None:
        self._enter(ServerState.OBSERVING, message, now.wall + self.config.observation_timeout)
        self._use_observation(now)

    def _use_observation(self, now: Moment) -> None:
        if (
            self._status.state != ServerState.OBSERVING
            or self._goal != _GoalPhase.NONE
            or self._latest is None
        ):
            return
        stamp_ns, observation = self._latest
        age = (now.ros_ns - stamp_ns) * 1e-9
        if self._earliest_ns > now.ros_ns + int(10e9):  # ROS time was reset: the old bound means nothing now
            self._earliest_ns = now.ros_ns
        if stamp_ns < self._earliest_ns or abs(age) > self.config.max_observation_age:
            return
        self._token += 1
        self._observed_ns = stamp_ns
        self._enter(ServerState.PROPOSING, "choosing", now.wall + self.config.inference_timeout)
        self._effects.start_inference(self._token, observation, self._status.instruction)

    def _execute(self, now: Moment) -> None:
        self._status = self._status._replace(step=self._status.step + 1)
        self._goal, self._goal_deadline = _GoalPhase.WAITING, now.wall + self.config.executor_timeout
        self._enter(ServerState.EXECUTING, f"step {self._status.step}: asking the executor")
        if self._effects.executor_is_ready():
            self._send(now)

    def _send(self, now: Moment) -> None:
        assert self._proposal is not None
        self._goal, self._goal_deadline = _GoalPhase.SENT, now.wall + self.config.executor_timeout
        self._goal_token, self._executor_phase = self._goal_token + 1, ""
        self._effects.send_goal(self._goal_token, self._proposal, self._status.instruction)


def _one_line(text: str) -> str:
    """Printable, without line breaks or doubled blanks: it goes into logs and messages."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
