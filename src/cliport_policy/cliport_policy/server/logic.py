"""The policy server's behaviour: a state machine that knows neither ROS nor networks.

Events come in as method calls with the moment they happened; effects go out through the ports.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cliport_core import topics
from cliport_core.action import ActionGoal, Primitive
from cliport_core.errors import InstructionError
from cliport_core.instruction import asks_to_stop, normalized_instruction
from cliport_core.new_id import new_id
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_policy.errors import PolicyError
from cliport_policy.inference import Inference, NullAction
from cliport_policy.server.goal_tracker import GoalPhase, GoalTracker
from cliport_policy.server.types import BUSY, TRY_AGAIN, Answer, ExecutorPort, Moment, ServerConfig, ServerEffects
from cliport_policy.server.wording import (
    NOT_RESUMED,
    NOT_TOLD,
    STOPPED,
    absent_words,
    ended_words,
    excerpt,
    one_line,
    refused_words,
    stop_answer,
    unseen_words,
)

_CLOCK_RESET_NS = 10_000_000_000  # ROS time this far before what was waited for has been set back


class PolicyServer:
    """Drives the executor from an instruction to its goal, until a limit ends it or it is stopped."""

    def __init__(
        self,
        config: ServerConfig,
        effects: ServerEffects,
        check_instruction: Callable[[str], None],
        executor: ExecutorPort,
    ) -> None:
        """Begin idle. check_instruction raises PolicyError, one line, for a text that must not be acted on."""
        self.config = config
        self._effects = effects
        self._check_instruction = check_instruction
        self._executor = executor
        self._goal = GoalTracker(config, executor)
        self._status = ServerStatus(PolicyState.IDLE, "ready", "", 0)
        self._stopped, self._held = False, ""  # held: why no instruction is taken now
        self._token = 0  # of the current inference
        self._deadline: float | None = None  # of the current state, wall clock
        self._earliest_ns = 0  # observations taken before this show the past
        self._latest: tuple[int, Any] | None = None  # (stamp_ns, observation)
        self._complaint = 0, ""  # of perception: (ROS time [ns], words)
        self._observed_ns = 0  # stamp of the observation being worked on
        self._proposal: ActionGoal | None = None
        self._misses = 0

    @property
    def status(self) -> ServerStatus:
        """The status as last published."""
        return self._status

    def announce(self) -> None:
        """Publish the status as it is (at start)."""
        self._effects.publish_status(self._status)

    # what people ask for

    def on_instruction(self, text: str, now: Moment) -> None:
        """Take a new instruction; an empty one, stop, halt and cancel end the current.

        A busy server drops what it was doing.
        """
        was_busy = self._status.state in BUSY
        self._abandon(now)
        try:
            instruction = normalized_instruction(text)
        except InstructionError as error:
            self._status = self._status._replace(instruction=excerpt(text), step=0)
            self._fail(refused_words(str(error), was_busy))
            return
        self._status = self._status._replace(instruction=instruction, step=0)
        if asks_to_stop(instruction):
            self._enter(PolicyState.IDLE, ended_words(instruction, was_busy))
            return
        if self._stopped or self._held:
            self._fail(self._held or f"the server is stopped: call {topics.RESUME} first")
            return
        try:
            self._check_instruction(instruction)
        except PolicyError as error:
            self._fail(refused_words(str(error), was_busy))
            return
        self._misses = 0
        # the scene may just have been rearranged
        self._earliest_ns = max(self._earliest_ns, now.ros_ns - int(self.config.look_back * 1e9))
        self._observe("waiting for a fresh heightmap", now)

    def approve(self, proposal_id: str, now: Moment) -> Answer:
        """Run the proposal, or have the executor run the plan, of that id and no other, as a person agrees to it."""
        state, waiting = self._status.state, self._status.proposal_id
        if not waiting or self._proposal is None:
            return Answer(False, f"nothing waits for approval: the server is {state.name}")
        kind = "plan" if state == PolicyState.EXECUTING else "proposal"
        if proposal_id != waiting:
            return Answer(False, f"the {kind} that waits is {waiting}, not {proposal_id or 'one without an id'}")
        if state == PolicyState.EXECUTING:
            told = self._executor.approve(waiting)
            return Answer(told, "the executor is told" if told else f"{topics.EXECUTOR_APPROVE} is not there")
        age = (now.ros_ns - self._proposal.stamp_ns) * 1e-9
        if age > self.config.max_proposal_age:
            self._observe(f"the proposal is {age:.0f} s old, looking again", now)
            return Answer(False, f"the proposal is {age:.0f} s old: a new one follows")
        self._execute(self._proposal, now)
        return Answer(True, "approved")

    def stop(self, now: Moment) -> Answer:
        """Stop until `resume`: nothing moves before it."""
        self._stopped = True
        told = self._executor.stop()
        self._abandon(now)
        words = STOPPED if told else f"{STOPPED}; but {NOT_TOLD}"
        self._enter(PolicyState.IDLE, words)
        return Answer(told, words)

    def confirm_stop(self, answer: Answer | None) -> Answer:
        """Return what to say to who asked for a stop, once the executor answered; None: it did not."""
        confirmed = stop_answer(answer)
        if self._stopped and not confirmed.success:
            self._enter(PolicyState.IDLE, confirmed.message)
        return confirmed

    def resume(self) -> Answer:
        """End a stop; the next instruction is acted on again. No success where the executor was not told."""
        told = self._executor.resume()
        if self._stopped:
            self._stopped = False
            self._enter(PolicyState.IDLE, self._held or "ready")
        return Answer(told, "ready for an instruction" if told else NOT_RESUMED)

    def hold(self, why: str) -> Answer:
        """Take no instruction until `release`, for this reason; refused while something goes on."""
        if self._held or self._status.state in BUSY:
            return Answer(False, self._held or f"the server is {self._status.state.name}: end that first")
        if self._goal.phase != GoalPhase.NONE:
            return Answer(False, "the motion that was cancelled has not ended yet: try again then")
        self._held = why
        self._enter(PolicyState.IDLE, why)
        return Answer(True, why)

    def release(self, words: str) -> None:
        """Take instructions again, and say why."""
        self._held = ""
        self._enter(PolicyState.IDLE, f"{words}; {STOPPED}" if self._stopped else words)

    # what the camera and the policy say

    def on_observation(self, stamp_ns: int, observation: Any, now: Moment) -> None:
        """Take a heightmap; stamp_ns is when its images were taken."""
        self._latest = stamp_ns, observation
        self._use_observation(now)

    def on_complaint(self, words: str, stamp_ns: int) -> None:
        """Note why perception made no heightmap at a time."""
        self._complaint = stamp_ns, words

    def on_proposal(self, token: int, inference: Inference, now: Moment) -> None:
        """Take the policy's answer."""
        if token != self._token or self._status.state != PolicyState.PROPOSING:
            return
        config, step = self.config, self._status.step
        nothing = inference.null_action(config.done_threshold, config.absent_threshold)
        if nothing is NullAction.DONE:
            done = f"the goal looks reached after {step} steps" if step else "the goal looks reached already"
            self._enter(PolicyState.DONE, done)
        elif nothing is NullAction.ABSENT:
            self._fail(absent_words(self._status.instruction, inference.missing))
        elif step >= config.max_steps:
            self._fail(f"step limit of {config.max_steps} reached")
        elif inference.confidence < config.min_confidence:
            self._fail(
                f"not sure enough where to act (pick {inference.pick_confidence:.2f}, place "
                f"{inference.place_confidence:.2f}, at least {config.min_confidence:.2f} needed)"
            )
        else:
            self._proposal = ActionGoal(inference.action, self._status.instruction, self._observed_ns)
            self._effects.publish_proposal(self._proposal)
            if config.require_approval:
                proposal_id = new_id()
                words = f"proposal {proposal_id} waits for a call of {topics.APPROVE} with its id"
                self._enter(PolicyState.WAITING_FOR_APPROVAL, words, proposal_id=proposal_id)
            else:
                self._execute(self._proposal, now)

    def on_inference_failed(self, token: int, message: str) -> None:
        """Note that the policy could not answer."""
        if token == self._token and self._status.state == PolicyState.PROPOSING:
            self._fail(message)

    # what the executor says

    def on_heartbeat(self, now: Moment) -> None:
        """Note that the executor lives."""
        self._goal.on_heartbeat(now)

    def on_goal_response(self, token: int, accepted: bool, now: Moment) -> None:
        """Note that the executor took the goal or not."""
        if self._goal.on_response(token, accepted, now):
            self._note_rest(now)
            if self._status.state == PolicyState.EXECUTING:
                self._fail("the executor refused the goal: is it busy or stopped?")

    def on_feedback(self, token: int, phase: str, now: Moment, waiting_plan: str = "") -> None:
        """Note the executor's phase, and the id of the plan that waits there for approval."""
        if self._goal.on_feedback(token, phase, now):
            waits = f"plan {waiting_plan} waits for a call of {topics.APPROVE} with its id" if waiting_plan else phase
            self._enter(PolicyState.EXECUTING, f"step {self._status.step}: {waits}", proposal_id=waiting_plan)

    def on_result(self, token: int, result: ActionResult, now: Moment) -> None:
        """Take the executor's result of a goal."""
        wanted = self._goal.phase != GoalPhase.CANCELLING and self._status.state == PolicyState.EXECUTING
        if not self._goal.on_result(token):
            return
        self._note_rest(now)
        if not wanted:
            return
        outcome = result.outcome
        if outcome == Outcome.SUCCEEDED:
            self._misses = 0
            self._observe(f"step {self._status.step} done, looking again", now)
        elif outcome in TRY_AGAIN and self._misses < self.config.retries:
            self._misses += 1
            self._observe(f"{outcome.label}, trying again ({self._misses} of {self.config.retries})", now)
        else:
            self._fail(f"executor: {outcome.name}" + (f": {one_line(result.message)}" if result.message else ""))

    # what the clock says

    def tick(self, now: Moment) -> None:
        """End the waits that nothing else ends; call often (20 Hz)."""
        reason = self._goal.tick(now)
        if reason is not None:
            if self._goal.phase == GoalPhase.NONE:
                self._note_rest(now)
            self._fail(reason)
        state, config = self._status.state, self.config
        self._use_observation(now)
        if self._deadline is None or now.wall < self._deadline or self._goal.phase != GoalPhase.NONE:
            return
        if state == PolicyState.OBSERVING:
            at_ns, complaint = self._complaint
            is_newer = self._latest is None or at_ns > self._latest[0]
            self._fail(unseen_words(config.observation_timeout, complaint if is_newer else ""))
        elif state == PolicyState.PROPOSING:
            self._fail(f"the policy gave no answer within {config.inference_timeout:.0f} s")

    # transitions

    def _enter(self, state: PolicyState, message: str, deadline: float | None = None, proposal_id: str = "") -> None:
        shown = self._proposal if state in (PolicyState.WAITING_FOR_APPROVAL, PolicyState.EXECUTING) else None
        confidence = shown.action.confidence if shown else None
        primitive = shown.action.primitive if shown else Primitive.PICK_PLACE
        self._deadline = deadline
        self._status = self._status._replace(
            state=state, message=message, confidence=confidence, primitive=primitive, proposal_id=proposal_id
        )
        self._effects.publish_status(self._status)

    def _fail(self, reason: str) -> None:
        self._token += 1
        self._enter(PolicyState.FAILED, reason)

    def _abandon(self, now: Moment) -> None:
        """Forget the current instruction; a running motion is cancelled."""
        self._token += 1
        self._proposal = None
        self._goal.cancel(now)

    def _note_rest(self, now: Moment) -> None:
        """The arm rests from now on: only what is seen afterwards counts."""
        self._earliest_ns = now.ros_ns + int(self.config.settle * 1e9)
        if self._status.state == PolicyState.OBSERVING:
            self._deadline = now.wall + self.config.observation_timeout

    def _observe(self, message: str, now: Moment) -> None:
        self._enter(PolicyState.OBSERVING, message, now.wall + self.config.observation_timeout)
        self._use_observation(now)

    def _use_observation(self, now: Moment) -> None:
        """Start thinking, when an observation is wanted and a fresh one of the arm at rest is there."""
        waiting = self._status.state == PolicyState.OBSERVING and self._goal.phase == GoalPhase.NONE
        if not waiting or self._latest is None:
            return
        if self._earliest_ns > now.ros_ns + _CLOCK_RESET_NS:
            self._earliest_ns = now.ros_ns
        stamp_ns, observation = self._latest
        age = (now.ros_ns - stamp_ns) * 1e-9
        if stamp_ns < self._earliest_ns or abs(age) > self.config.max_observation_age:
            return
        self._token += 1
        self._observed_ns = stamp_ns
        self._enter(PolicyState.PROPOSING, "choosing", now.wall + self.config.inference_timeout)
        self._effects.start_inference(self._token, observation, self._status.instruction)

    def _execute(self, goal: ActionGoal, now: Moment) -> None:
        step = self._status.step + 1
        self._status = self._status._replace(step=step)
        self._enter(PolicyState.EXECUTING, f"step {step}: asking the executor")
        self._goal.begin(goal, now)
