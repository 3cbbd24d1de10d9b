"""Work of the arm, the policy and the disk for the station: one activity at a time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from cliport_core.outcome import ActionResult, Outcome
from demo_tool.activity import Activity, StationHooks
from demo_tool.bulletin import Bulletin
from demo_tool.draft_desk import DrawnAction
from demo_tool.errors import NotNowError
from demo_tool.motion import Motion
from demo_tool.plan_approval import PlanApproval
from demo_tool.ports import Arm, Policy
from demo_tool.proposing import Proposals
from demo_tool.reach_check import ReachCheck, plan_shown, plan_words
from demo_tool.recording import Recorder
from demo_tool.recovery import Recovery
from demo_tool.station_config import StationConfig
from demo_tool.step_keeper import MovedStep, StepKeeper
from demo_tool.steps import goal_of, record_of, setup_of
from demo_tool.wording import outcome_words, phase_words
from demo_tool.work import Job

T = TypeVar("T")
_CLOSE_SPARE = 1.0  # beyond what a cancel may take [s]
_CLOSED = "the station was closed"


class ArmWork:
    """Activities of the arm, the policy and the disk: they are begun, watched and ended here.

    Safe between threads: the bulletin's lock guards it, and no port waits. run: calls long work in another thread;
    clock: steady time [s].
    """

    def __init__(
        self,
        config: StationConfig,
        arm: Arm,
        policy: Policy,
        recorder: Recorder,
        bulletin: Bulletin,
        run: Callable[[Job], None],
        clock: Callable[[], float],
        hooks: StationHooks,
    ) -> None:
        self._config, self._arm = config, arm
        self._recorder, self._bulletin = recorder, bulletin
        self._run, self._clock = run, clock
        self._hooks = hooks
        self._keeper = StepKeeper(recorder, config)
        self._motion: Motion | None = None
        self._is_writing = False
        self.approval = PlanApproval(arm, bulletin, config.answer_timeout, lambda: self._motion)
        self.proposals = Proposals(policy, config, bulletin)
        self.recovery = Recovery(arm, config, bulletin, hooks)
        self.reach = ReachCheck(arm, config.reach_delay, hooks, bulletin, self._show_plan)
        self.stopped = False
        self.stop_failure = ""  # why the arm may move although it was stopped
        self.plan: dict[str, object] | None = None

    @property
    def activity(self) -> Activity:
        """Present activity."""
        return self.present()[0]

    def present(self) -> tuple[Activity, str]:
        """Return the present activity and a phrase for it, both of one moment."""
        motion = self._motion  # read once: another thread may end it meanwhile
        if self._is_writing:
            return Activity.RECORDING, "writing to the disk"
        if waiting := self.approval.waiting(motion):
            return Activity.WAITING, f"approve plan {waiting}, or refuse it by STOP"
        if recovering := self.recovery.words:
            return Activity.RECOVERING, recovering
        if motion is not None:
            approved = "the plan is approved, and checked again" if motion.waiting_plan else ""
            return Activity.EXECUTING if motion.moved else Activity.PLANNING, approved or phase_words(motion.phase)
        if self.proposals.request is not None:
            return Activity.PROPOSING, "the policy is looking"
        return Activity.NONE, ""

    @property
    def progress(self) -> tuple[str, float]:
        """Phase of the motion, and the share of it that is done."""
        motion = self._motion
        return ("", 0.0) if motion is None else (motion.phase, motion.progress)

    def refuse_when_busy(self) -> None:
        """Raise NotNowError while an activity goes on."""
        activity, words = self.present()
        if activity is not Activity.NONE:
            raise NotNowError(f"busy {activity.words} ({words}): wait for its end, or stop")

    def refuse_motion(self) -> None:
        """Raise NotNowError when the arm must not or cannot be asked for anything."""
        self._refuse_when_arm_is_taken()
        fault = self._arm.fault()
        if fault is not None:
            raise NotNowError(fault)

    def preview(self, drawn: DrawnAction, instruction: str) -> None:
        """Have the arm plan the action, without moving."""
        self.refuse_motion()
        goal = goal_of(drawn, instruction, plan_only=True)
        self._start(Motion(self._arm, goal, self._config, self._bulletin.touch, self._on_planned))

    def execute(self, drawn: DrawnAction, instruction: str) -> None:
        """Move the arm, then record the step with its result."""
        self.refuse_motion()
        setup = setup_of(drawn.view, self._config)
        self._recorder.check(setup)

        def on_change() -> None:
            with self._bulletin.lock:
                if motion.moved and self._motion is motion:
                    self._hooks.film.begin()
                self._bulletin.touch()

        def on_end(result: ActionResult) -> None:
            self._on_moved(motion, drawn, result)

        motion = Motion(self._arm, goal_of(drawn, instruction), self._config, on_change, on_end)
        self.write_to_disk(lambda: self._recorder.begin_episode(setup))
        self._start(motion)

    def recover(self) -> None:
        """Move the arm back to its ready pose."""
        self._without_goal(lambda: self.recovery.begin(self._clock()))

    def open_hand(self) -> None:
        """Let go what the hand holds, where it is."""
        self._without_goal(self.recovery.open_hand)

    def _without_goal(self, begin: Callable[[], None]) -> None:
        """Call what begins a motion that has no goal, once the arm is free for it."""
        self.refuse_motion()
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._refuse_when_arm_is_taken()
            self.reach.give_way(begin, self._clock())

    def record(self, drawn: DrawnAction, instruction: str) -> str:
        """Record the step without moving the arm; return a sentence for the page."""
        setup = setup_of(drawn.view, self._config)
        self._recorder.check(setup)

        def write() -> None:
            self._recorder.begin_episode(setup)
            self._recorder.add_step(
                drawn.view.to_record(), lambda step: record_of(step, drawn, instruction, None, self._config)
            )

        self.write_to_disk(write)
        self._hooks.on_recorded()
        return "recorded without moving the arm"

    def write_to_disk(self, write: Callable[[], T]) -> T:
        """Call `write` in this thread, with the lock released, and let nothing else begin; return its result."""
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._is_writing = True
            self._bulletin.touch()
        try:
            return write()
        finally:
            self._is_writing = False
            self._bulletin.touch()

    @property
    def unsaved(self) -> MovedStep | None:
        """Step that moved the arm and could not be recorded."""
        return self._keeper.unsaved

    def refuse_when_unsaved(self) -> None:
        """Raise NotNowError while there is an unsaved step."""
        self._keeper.refuse_when_unsaved()

    def save_again(self) -> str:
        """Record the unsaved step; return a sentence for the page."""
        step = self.write_to_disk(self._keeper.save_again)
        self._hooks.on_recorded()
        self._bulletin.clear_failure()
        return f"recorded; {step.words}"

    def drop_unsaved(self) -> str:
        """Drop the unsaved step; return a sentence for the page."""
        self._keeper.drop()
        self._bulletin.clear_failure()
        return "the step that was not saved is dropped; the arm does not go back, and the objects stay where they are"

    def propose(self, instruction: str) -> None:
        """Ask the policy for a proposal."""
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._refuse_when_arm_is_taken()
            self.proposals.begin(instruction, self._clock())

    def stop(self, reason: str) -> tuple[bool, str]:
        """Stop the arm until `resume`, before waiting for the lock.

        Returns True if nothing is known that keeps the stop from the arm, and a sentence for the page. A stop that
        turns out not to have reached the arm is announced as a failure.
        """
        self.stopped = True
        self._arm.stop(reason, self._on_stop_failure)
        fault = self._arm.fault()
        with self._bulletin.lock:
            self._cancel("stopped")
        if fault is not None:
            return False, f"STOP may not have reached the arm: {fault}"
        return True, "stopped: nothing moves until you resume"

    def resume(self) -> str:
        """End a stop; return a sentence for the page."""
        self._arm.resume()
        self.stopped, self.stop_failure = False, ""
        return "ready again; look where the arm and the objects are"

    def close(self) -> None:
        """Cancel the activity, a recovery by a stop, which holds, and wait a moment until its step is written."""
        with self._bulletin.lock:
            self._cancel(_CLOSED)
            if self.activity is Activity.RECOVERING:
                self._arm.stop(_CLOSED, self._on_stop_failure)
        end = self._clock() + self._config.cancel_timeout + _CLOSE_SPARE
        while self.activity is not Activity.NONE and self._clock() < end:
            time.sleep(0.01)
        if self.activity in (Activity.NONE, Activity.RECOVERING):
            self._keeper.close()

    def tick(self) -> None:
        """End waits that have lasted too long; to be called often."""
        now = self._clock()
        with self._bulletin.lock:
            if self._motion is not None:
                self._motion.tick(now)
            self.approval.tick(now)
            self.recovery.tick(now)
            self.proposals.tick(now)

    def _cancel(self, why: str) -> None:
        if self._motion is not None:
            self._motion.cancel(self._clock())
        self.recovery.stop(self._clock())
        self.proposals.cancel(why)

    def _refuse_when_arm_is_taken(self) -> None:
        if self.stopped:
            raise NotNowError("the arm is stopped: resume first")
        if self._hooks.policy_moves():
            raise NotNowError("the policy server is moving the arm: wait for its end, or stop")

    def _on_stop_failure(self, words: str) -> None:
        with self._bulletin.lock:
            if self.stopped:
                self.stop_failure = words
                self._bulletin.fail(words)

    def _start(self, motion: Motion) -> None:
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._motion, self.plan = motion, None
            self.approval.forget()
            self._bulletin.clear_failure()
            self._bulletin.touch()
            if self.stopped:
                motion.abandon("stopped before anything moved")
            else:
                self.reach.give_way(lambda: motion.begin(self._clock()), self._clock())

    def _on_planned(self, result: ActionResult) -> None:
        with self._bulletin.lock:
            self._motion = None
            self.plan, words = plan_shown(result), plan_words(result)
            if self.plan is None:
                self._bulletin.fail(f"it was not found out whether the arm can do this: {words}")
            elif self.plan["reachable"]:
                self._bulletin.say(f"the arm can do this: {words}")
            else:
                self._bulletin.fail(f"the arm cannot do this: {words}")

    def _show_plan(self, plan: dict[str, object]) -> None:
        self.plan = plan
        self._bulletin.touch()

    def _on_moved(self, motion: Motion, drawn: DrawnAction, result: ActionResult) -> None:
        words = outcome_words(result.outcome) + (f": {result.message}" if result.message else "")
        with self._bulletin.lock:
            self._motion = None
            if not motion.moved:
                self._bulletin.fail(f"nothing moved and nothing was recorded; {words}")
                return
            self._hooks.on_rest()
            self._is_writing = True
            self._bulletin.touch()
        self._hooks.film.end()
        self._run(lambda: self._write_step(MovedStep(drawn, motion.goal.instruction, result, words)))

    def _write_step(self, step: MovedStep) -> None:
        step = replace(step, video=self._hooks.film.taken())
        failure, words = self._keeper.saved_or_why_not(step), step.words
        with self._bulletin.lock:
            self._is_writing = False
            if failure:
                self._bulletin.fail(failure)
                return
            self._hooks.on_recorded()
            if step.result.outcome is Outcome.SUCCEEDED:
                self._bulletin.say(f"recorded; {words}")
            else:
                self._bulletin.fail(f"recorded as it went: {words}. Undo drops the step; the arm does not go back")
