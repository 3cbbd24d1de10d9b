"""What the arm, the policy and the disk are busy with for the station: one thing at a time."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import Enum
from typing import TypeVar

from cliport_episodes.errors import EpisodesError
from cliport_perception.errors import PerceptionError
from cliport_perception.primitive import Outcome
from demo_tool.bulletin import Bulletin
from demo_tool.draft_desk import Choice
from demo_tool.errors import NotNowError, StationError
from demo_tool.motion import Motion
from demo_tool.ports import Arm, ArmResult, Policy
from demo_tool.proposing import Proposal, ProposalRequest
from demo_tool.recording import Recorder
from demo_tool.station_config import StationConfig
from demo_tool.steps import goal_of, record_of, setup_of
from demo_tool.wording import outcome_words, phase_words
from demo_tool.work import Job

T = TypeVar("T")
_CLOSING = 1.0  # for a cancelled goal's last words [s]
EXPECTED = (StationError, EpisodesError, PerceptionError, OSError)


class Activity(Enum):
    """What is going on; values as the page has them."""

    NONE = "ready"
    PLANNING = "planning"
    EXECUTING = "executing"
    RECORDING = "recording"
    PROPOSING = "proposing"


class ArmWork:
    """Begins, watches and ends. Safe between threads: the bulletin's lock guards it, and no port waits.

    run: does long work elsewhere; clock: steady [s]; on_recorded: called after a step was recorded;
    on_rest: after the arm moved; policy_moves: whether the policy server has the arm.
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
        on_recorded: Callable[[], None],
        on_rest: Callable[[], None],
        policy_moves: Callable[[], bool],
    ) -> None:
        self._config, self._arm, self._policy = config, arm, policy
        self._recorder, self._bulletin = recorder, bulletin
        self._run, self._clock = run, clock
        self._on_recorded, self._on_rest, self._policy_moves = on_recorded, on_rest, policy_moves
        self._motion: Motion | None = None
        self._request: ProposalRequest | None = None
        self._on_disk = False
        self.stopped = False
        self.proposal: Proposal | None = None
        self.plan: dict[str, object] | None = None

    @property
    def activity(self) -> Activity:
        """What is going on."""
        if self._on_disk:
            return Activity.RECORDING
        if self._motion is not None:
            return Activity.EXECUTING if self._motion.moved else Activity.PLANNING
        return Activity.PROPOSING if self._request is not None else Activity.NONE

    @property
    def words(self) -> str:
        """Of the activity."""
        if self._motion is not None:
            return phase_words(self._motion.phase)
        return {
            Activity.RECORDING: "writing to the disk",
            Activity.PROPOSING: "the policy is looking",
        }.get(self.activity, "")

    @property
    def progress(self) -> tuple[str, float]:
        """Phase and share done of the motion."""
        return ("", 0.0) if self._motion is None else (self._motion.phase, self._motion.progress)

    def refuse_when_busy(self) -> None:
        """Raises NotNowError."""
        activity = self.activity
        if activity is not Activity.NONE:
            raise NotNowError(f"busy {activity.value} ({self.words}): wait for its end, or stop")

    def refuse_motion(self) -> None:
        """Raises NotNowError when the arm must not or cannot be asked for anything."""
        self._refuse_when_taken()
        fault = self._arm.fault()
        if fault is not None:
            raise NotNowError(fault)

    def preview(self, choice: Choice, instruction: str) -> None:
        """Ask whether the arm could; nothing moves."""
        self.refuse_motion()
        goal = goal_of(choice, instruction, plan_only=True)
        self._start(Motion(self._arm, goal, self._config, self._bulletin.touch, self._planned))

    def execute(self, choice: Choice, instruction: str) -> None:
        """Move the arm, then record the step as it ended."""
        self.refuse_motion()
        setup = setup_of(choice.view, self._config)
        self._recorder.check(setup)

        def on_end(result: ArmResult) -> None:
            self._moved(motion, choice, result)

        motion = Motion(self._arm, goal_of(choice, instruction), self._config, self._bulletin.touch, on_end)
        self.on_disk(lambda: self._recorder.begin_episode(setup))
        self._start(motion)

    def record(self, choice: Choice, instruction: str) -> str:
        """Record the step without moving."""
        setup = setup_of(choice.view, self._config)
        self._recorder.check(setup)

        def write() -> None:
            self._recorder.begin_episode(setup)
            self._recorder.add_step(
                choice.view.raw, lambda step: record_of(step, choice, instruction, None, self._config)
            )

        self.on_disk(write)
        self._on_recorded()
        return "recorded without moving the arm"

    def on_disk(self, write: Callable[[], T]) -> T:
        """Write in this thread, while nothing else begins; the lock is not held."""
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._on_disk = True
            self._bulletin.touch()
        try:
            return write()
        finally:
            self._on_disk = False
            self._bulletin.touch()

    def propose(self, instruction: str) -> None:
        """Ask the policy where it would act."""
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._refuse_when_taken()
            self.proposal = None
            self._bulletin.forgive()
            self._request = ProposalRequest(self._policy, instruction, self._config, self._proposed)
            self._request.begin(self._clock())
            self._bulletin.touch()

    @property
    def request(self) -> ProposalRequest | None:
        """The proposal that is waited for."""
        return self._request

    def stop(self, reason: str) -> str:
        """Latching; the arm is told before anything else, whatever holds the lock."""
        self.stopped = True
        self._arm.stop(reason)
        fault = self._arm.fault()
        with self._bulletin.lock:
            if self._motion is not None:
                self._motion.cancel(self._clock())
            if self._request is not None:
                self._request.cancel("stopped")
        return "stopped: nothing moves until you resume" + (f"; but {fault}" if fault is not None else "")

    def resume(self) -> str:
        """End a stop."""
        self._arm.resume()
        self.stopped = False
        return "ready again; look where the arm and the objects are"

    def close(self) -> None:
        """Cancel what runs, and wait a moment until it is written."""
        with self._bulletin.lock:
            if self._motion is not None:
                self._motion.cancel(self._clock())
            if self._request is not None:
                self._request.cancel("the station was closed")
        end = self._clock() + _CLOSING
        while self.activity is not Activity.NONE and self._clock() < end:
            time.sleep(0.01)

    def tick(self) -> None:
        """Call often: waits end here when nothing else ends them."""
        now = self._clock()
        with self._bulletin.lock:
            if self._motion is not None:
                self._motion.tick(now)
            if self._request is not None:
                self._request.tick(now)

    def _refuse_when_taken(self) -> None:
        if self.stopped:
            raise NotNowError("the arm is stopped: resume first")
        if self._policy_moves():
            raise NotNowError("the policy server is moving the arm: wait for its end, or stop")

    def _start(self, motion: Motion) -> None:
        with self._bulletin.lock:
            self.refuse_when_busy()
            self._motion, self.plan = motion, None
            self._bulletin.forgive()
            self._bulletin.touch()
            if self.stopped:
                motion.abandon("stopped before anything moved")
            else:
                motion.begin(self._clock())

    def _planned(self, result: ArmResult) -> None:
        with self._bulletin.lock:
            self._motion = None
            reachable = result.outcome is Outcome.PLANNED
            words = result.message or outcome_words(result.outcome)
            self.plan = {"reachable": reachable, "words": words}
            if reachable:
                self._bulletin.say(f"the arm can do this: {words}")
            else:
                self._bulletin.fail(f"the arm cannot do this: {words}")

    def _moved(self, motion: Motion, choice: Choice, result: ArmResult) -> None:
        words = outcome_words(result.outcome) + (f": {result.message}" if result.message else "")
        with self._bulletin.lock:
            self._motion = None
            if not motion.moved:
                self._bulletin.fail(f"nothing moved and nothing was recorded; {words}")
                return
            self._on_rest()
            self._on_disk = True
            self._bulletin.touch()
        self._run(lambda: self._write_step(choice, motion.goal.instruction, result, words))

    def _write_step(self, choice: Choice, instruction: str, result: ArmResult, words: str) -> None:
        failure = ""
        try:
            self._recorder.add_step(
                choice.view.raw, lambda step: record_of(step, choice, instruction, result, self._config)
            )
        except EXPECTED as error:
            failure = f"the arm moved ({words}), but the step was not recorded: {error}"
        except Exception as error:  # a defect must not leave the station recording for ever
            failure = f"the step was not recorded: internal error: {type(error).__name__}: {error}"
        with self._bulletin.lock:
            self._on_disk = False
            if failure:
                self._bulletin.fail(failure)
                return
            self._on_recorded()
            if result.outcome is Outcome.SUCCEEDED:
                self._bulletin.say(f"recorded; {words}")
            else:
                self._bulletin.fail(f"recorded as it went: {words}. Undo drops the step; the arm does not go back")

    def _proposed(self, proposal: Proposal | None, why: str) -> None:
        with self._bulletin.lock:
            self._request, self.proposal = None, proposal
            if proposal is None:
                self._bulletin.fail(why)
            else:
                self._bulletin.say("the policy has a proposal: correct it, or draw your own")
