"""The commands of a run to arm and gripper, each checked before it is sent and judged after it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cliport_core import topics
from cliport_core.outcome import Outcome
from panda_executor.config import ExecutorConfig
from panda_executor.departure import depart_from
from panda_executor.errors import TrajectoryError
from panda_executor.hand_content import HandContent
from panda_executor.hand_geometry import HandShape
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.ports import ArmPort, GripperPort, MotionStatus, ShouldStop
from panda_executor.trajectory import JointTrajectory
from panda_executor.validation import validate_trajectory
from panda_model.limits import FloatArray, JointLimits

OnPhase = Callable[[Phase, float], None]
OnPlan = Callable[[Sequence[Motion]], bool]

_CLOSE_ENOUGH = 0.003  # the fingers need not close for less [m]
_OPEN_ENOUGH = 0.0005  # nor open for less [m]
_RELEASE_WIDENING = 0.006  # the fingers open at least this much to let go [m]


class EarlyEnd(Exception):
    """The end of a run before its last phase.

    may_recover: whether the arm stands still and can be moved back.
    """

    def __init__(self, outcome: Outcome, message: str, may_recover: bool = False) -> None:
        super().__init__(message)
        self.outcome, self.may_recover = outcome, may_recover


class LoadLost(Exception):
    """The fingers closed or opened while they carried something."""


class RunCommands:
    """Moves the arm and the fingers for one run.

    Args:
        limits: that each trajectory must keep.
        on_phase: called with each phase as it begins and the overall progress 0..1.
        should_stop: polled all the time.
        hand: what is known of the hand's content; it outlives the run.
        on_plan: told the motions of a plan; returns once it may be executed, True where that took a person's time;
            raises RequestError when it may not.
    """

    def __init__(
        self,
        arm: ArmPort,
        gripper: GripperPort,
        config: ExecutorConfig,
        limits: JointLimits,
        on_phase: OnPhase,
        should_stop: ShouldStop,
        hand: HandContent | None = None,
        on_plan: OnPlan = lambda motions: False,
    ) -> None:
        self._on_plan = on_plan
        self._hand = hand or HandContent(config.missed_width, config.hand.opening)
        self.moved = False
        self._share = 0.0  # of the whole action that is done
        self._arm, self._gripper, self._limits = arm, gripper, limits
        self.config = config
        self._on_phase = on_phase
        self.should_stop = should_stop

    def positions(self) -> FloatArray:
        """Return the arm's measured positions (7,) [rad]."""
        return np.array(self._arm.joint_positions(), dtype=np.float64)

    def width(self) -> float:
        """Return the distance between the fingers [m]."""
        return self._gripper.width()

    def hand_shape(self) -> HandShape:
        """Return the hand's shape with what it holds, as far as that is known."""
        return self._hand.load(self._gripper.width()) or HandShape(self.config.hand)

    def is_empty(self) -> bool:
        """Return True if the fingers hold nothing."""
        return self._gripper.width() < self.config.missed_width

    def has_lost(self) -> bool:
        """Return True if the fingers do not hold any more what they closed on."""
        return self._hand.has_lost(self._gripper.width())

    def offer(self, motions: Sequence[Motion]) -> bool:
        """Show a plan and wait until it may be executed; return True if the scene may have changed meanwhile.

        Raises:
            RequestError: when nobody approved it in time, or before a stop was asked for.
            EarlyEnd: when a stop was asked for.
        """
        waited = self._on_plan(motions)
        self.check_stop()
        return waited

    def check_empty(self) -> None:
        """Check that the hand does not still hold what it closed on in an earlier run.

        Raises:
            RequestError: says how wide that is.
        """
        self._hand.check_empty(self._gripper.width())

    def check_stop(self) -> None:
        """Check that nobody asked for a stop. Raises EarlyEnd."""
        if self.should_stop():
            raise EarlyEnd(Outcome.CANCELLED, "cancelled; the arm holds")

    def enter(self, phase: Phase) -> None:
        """Begin a phase. Raises EarlyEnd when a stop was asked for."""
        self.check_stop()
        self.progress(phase, 0.0)

    def progress(self, phase: Phase, within: float) -> None:
        """Tell how far a run is: the phase, and the share of it that is done, 0..1; on the way back that stays."""
        if phase is not Phase.RECOVERING:
            self._share = phase.progress(within)
        self._on_phase(phase, self._share)

    def move(self, motion: Motion, watch_load: bool = False, may_end_off: bool = False) -> None:
        """Begin a motion where the arm is measured now, validate it, send it, and wait for its end.

        Args:
            watch_load: stop as soon as the fingers do not hold any more what they closed on.
            may_end_off: objects may push the arm off the motion's goal, by the start tolerance at most.

        Raises:
            EarlyEnd: when a stop was asked for, the motion is not valid any more, or the arm did not do it.
            LoadLost: when watch_load and they do not.
        """
        self.enter(motion.phase)
        trajectory = self._validated(motion)
        self.check_stop()
        lost = False

        def stop() -> bool:
            nonlocal lost
            lost = lost or (watch_load and self.has_lost())
            return lost or self.should_stop()

        self.moved = True
        result = self._arm.execute(trajectory, stop)
        phase = motion.phase.name.lower()
        if not result.standing:
            raise self._unsure(f"the arm may still move after {phase}", result.message)
        if self.should_stop():
            raise EarlyEnd(Outcome.CANCELLED, f"cancelled during {phase}; the arm holds")
        if lost or (watch_load and self.has_lost()):
            raise LoadLost(f"the object was lost during {phase}")
        if result.status is MotionStatus.OFF_GOAL and may_end_off and self._is_near(motion.trajectory.end):
            return
        if result.status is not MotionStatus.SUCCEEDED:
            raise _failure(f"the arm's motion {result.status.value} during {phase}", result.status, result.message)

    def _unsure(self, what: str, message: str) -> EarlyEnd:
        """Return the end of a run after a motion that may not be over."""
        outcome = Outcome.CANCELLED if self.should_stop() else Outcome.EXECUTION_FAILED
        why = f": {message}" if message else ""
        return EarlyEnd(outcome, f"{what}{why}; look before you go on")

    def _is_near(self, positions: FloatArray) -> bool:
        return float(np.abs(self.positions() - positions).max()) <= self.config.start_tolerance

    def _validated(self, motion: Motion) -> JointTrajectory:
        """Return the motion's trajectory from where the arm is measured now, checked as a whole."""
        here = self.positions()
        try:
            trajectory = depart_from(motion.trajectory, here, self._limits, self.config.start_tolerance)
            validate_trajectory(trajectory, self._limits, motion.scene.leaving(here), motion.straightness)
        except TrajectoryError as error:
            words = f"{motion.phase.name.lower()} was not sent: {error}"
            raise EarlyEnd(Outcome.EXECUTION_FAILED, words, may_recover=True) from None
        return trajectory

    def move_fingers(self, width: float, effort: float, load: HandShape | None = None) -> None:
        """Move the fingers to a full width [m] with at most `effort` [N], unless they are there.

        Args:
            load: the hand's shape with what it is to close on.

        Raises:
            EarlyEnd: when a stop was asked for, or the gripper did not do it.
        """
        self.check_stop()
        if width > 0.0 and -_OPEN_ENOUGH < self._gripper.width() - width < _CLOSE_ENOUGH:
            if width >= self.config.hand.opening:  # so wide they hold nothing, nor what was as wide
                self._hand.note(width, self._gripper.width())
            return
        self._hand.begin(width, load)
        result = self._gripper.move(width, effort, self.should_stop)
        if not result.standing:
            raise self._unsure("the fingers may still move", result.message)
        if width == 0.0 or result.status is MotionStatus.SUCCEEDED:  # also where closing failed around something
            self._hand.note(width, self._gripper.width())
        self.check_stop()
        if result.status is not MotionStatus.SUCCEEDED:
            raise _failure(f"the gripper's motion {result.status.value}", result.status, result.message)

    def let_go(self, opening: float) -> None:
        """Open to `opening` [m], or until the fingers meet what is beside the object once it is free.

        Raises:
            EarlyEnd: when a stop was asked for, somebody else cancelled the motion, the fingers may still move, or the
                object is still held.
        """
        held = self._gripper.width()
        # what is held may be wider than it was seen
        wide = min(max(opening, held + _RELEASE_WIDENING), self.config.hand.opening)
        try:
            self.move_fingers(wide, self.config.open_force)
        except EarlyEnd as end:
            is_held = self._gripper.width() < held + _RELEASE_WIDENING / 2.0
            if is_held or not end.may_recover:
                raise


def _failure(what: str, status: MotionStatus, message: str) -> EarlyEnd:
    """Return the end of a run whose motion ended with `status` although the run asked for no stop."""
    if status is MotionStatus.CANCELLED:
        # Somebody stopped it at the controller: a motion back would be the answer to a stop.
        words = f"{what}: somebody else cancelled it; look, then call {topics.EXECUTOR_RECOVER}"
        return EarlyEnd(Outcome.EXECUTION_FAILED, f"{words} ({message})" if message else words)
    may_recover = status is not MotionStatus.UNAVAILABLE
    return EarlyEnd(Outcome.EXECUTION_FAILED, f"{what}: {message or 'no reason given'}", may_recover)
