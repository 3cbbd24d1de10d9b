"""The commands of a run to arm and gripper, each checked before it is sent and judged after it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cliport_core.outcome import Outcome
from panda_executor.config import ExecutorConfig
from panda_executor.errors import TrajectoryError
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.ports import ArmPort, GripperPort, MotionStatus, ShouldStop
from panda_executor.validation import validate_trajectory
from panda_model.limits import FloatArray, JointLimits

OnPhase = Callable[[Phase, float], None]

_CLOSE_ENOUGH = 0.003  # the fingers need not close for less [m]
_OPEN_ENOUGH = 0.0005  # nor open for less [m]
_RELEASE_WIDENING = 0.006  # the fingers open at least this much to let go [m]


class EarlyEnd(Exception):
    """The end of a run before its last phase."""

    def __init__(self, outcome: Outcome, message: str) -> None:
        super().__init__(message)
        self.outcome = outcome


class LoadLost(Exception):
    """The fingers closed on nothing while they carried something."""


class RunCommands:
    """Moves the arm and the fingers for one run.

    Args:
        limits: that each trajectory must keep.
        on_phase: called with each phase as it begins and the overall progress 0..1.
        should_stop: polled all the time.
    """

    def __init__(
        self,
        arm: ArmPort,
        gripper: GripperPort,
        config: ExecutorConfig,
        limits: JointLimits,
        on_phase: OnPhase,
        should_stop: ShouldStop,
    ) -> None:
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

    def is_empty(self) -> bool:
        """Return True if the fingers hold nothing."""
        return self._gripper.width() < self.config.missed_width

    def check_stop(self) -> None:
        """Check that nobody asked for a stop. Raises EarlyEnd."""
        if self.should_stop():
            raise EarlyEnd(Outcome.CANCELLED, "cancelled; the arm holds")

    def enter(self, phase: Phase) -> None:
        """Begin a phase. Raises EarlyEnd when a stop was asked for."""
        self.check_stop()
        self.progress(phase, 0.0)

    def progress(self, phase: Phase, within: float) -> None:
        """Tell how far a run is: the phase, and the share of it that is done, 0..1."""
        self._on_phase(phase, min((phase + within) / Phase.DONE, 1.0))

    def move(self, motion: Motion, watch_load: bool = False) -> None:
        """Validate a motion against where the arm is now, send it, and wait for its end.

        Args:
            watch_load: stop as soon as the fingers hold nothing.

        Raises:
            EarlyEnd: when a stop was asked for, the motion is not valid any more, or the arm did not do it.
            LoadLost: when watch_load and the fingers hold nothing.
        """
        self.enter(motion.phase)
        self._validate(motion)
        self.check_stop()
        lost = False

        def stop() -> bool:
            nonlocal lost
            lost = lost or (watch_load and self.is_empty())
            return lost or self.should_stop()

        result = self._arm.execute(motion.trajectory, stop)
        phase = motion.phase.name.lower()
        if not result.standing:
            outcome = Outcome.CANCELLED if self.should_stop() else Outcome.EXECUTION_FAILED
            why = f": {result.message}" if result.message else ""
            raise EarlyEnd(outcome, f"the arm was not seen to stand still after {phase}{why}; look before you go on")
        if self.should_stop():
            raise EarlyEnd(Outcome.CANCELLED, f"cancelled during {phase}; the arm holds")
        if lost or (watch_load and self.is_empty()):
            raise LoadLost(f"the object was lost during {phase}")
        if result.status is not MotionStatus.SUCCEEDED:
            why = result.message or "no reason given"
            raise EarlyEnd(Outcome.EXECUTION_FAILED, f"the arm's motion {result.status.value} during {phase}: {why}")

    def _validate(self, motion: Motion) -> None:
        here = self.positions()
        try:
            validate_trajectory(motion.trajectory, self._limits, motion.scene, here, self.config.start_tolerance)
        except TrajectoryError as error:
            raise EarlyEnd(Outcome.EXECUTION_FAILED, f"{motion.phase.name.lower()} was not sent: {error}") from None

    def move_fingers(self, width: float, effort: float) -> None:
        """Move the fingers to a full width [m] with at most `effort` [N], unless they are there.

        Raises:
            EarlyEnd: when a stop was asked for, or the gripper did not do it.
        """
        self.check_stop()
        if width > 0.0 and -_OPEN_ENOUGH < self._gripper.width() - width < _CLOSE_ENOUGH:
            return
        result = self._gripper.move(width, effort, self.should_stop)
        self.check_stop()
        if result.status is not MotionStatus.SUCCEEDED:
            why = result.message or "no reason given"
            raise EarlyEnd(Outcome.EXECUTION_FAILED, f"the gripper's motion {result.status.value}: {why}")

    def let_go(self, opening: float) -> None:
        """Open to `opening` [m], or until the fingers meet what is beside the object once it is free.

        Raises:
            EarlyEnd: when a stop was asked for, or the object is still held.
        """
        held = self._gripper.width()
        # what is held may be wider than it was seen
        wide = min(max(opening, held + _RELEASE_WIDENING), self.config.hand.opening)
        try:
            self.move_fingers(wide, self.config.open_force)
        except EarlyEnd as end:
            is_held = self._gripper.width() < held + _RELEASE_WIDENING / 2.0
            if end.outcome is not Outcome.EXECUTION_FAILED or is_held:
                raise
