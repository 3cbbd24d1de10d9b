"""The interface of an arm and a gripper; a simulator, a driver or a test hands in its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from panda_executor.trajectory import JointTrajectory
from panda_model.limits import FloatArray

ShouldStop = Callable[[], bool]


class MotionStatus(Enum):
    """The ways in which a motion can end."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    OFF_GOAL = "ended off its goal"
    REJECTED = "rejected"
    CANCELLED = "cancelled"
    TIMED_OUT = "timed out"
    UNAVAILABLE = "unavailable"


@dataclass(frozen=True)
class MotionResult:
    """The end of one motion; the message says why when it did not succeed.

    standing: whether the motion is known to be over and the arm was measured at rest afterwards; where not, nothing
    else may be moved.
    """

    status: MotionStatus
    message: str = ""
    standing: bool = True


@dataclass(frozen=True)
class GripperResult:
    """The end of the fingers' motion.

    width: between the fingers [m]; stalled: stopped by something; reached_goal: at the width asked for; status tells a
    gripper that could not move from one that was stopped by an object; standing: whether the motion is known to be
    over; where not, nothing else may be moved.
    """

    width: float
    stalled: bool
    reached_goal: bool
    status: MotionStatus = MotionStatus.SUCCEEDED
    message: str = ""
    standing: bool = True


class ArmPort(Protocol):
    """Seven joints that follow trajectories."""

    def joint_positions(self) -> FloatArray:
        """Return the positions (7,) [rad] as last measured."""

    def execute(self, trajectory: JointTrajectory, should_stop: ShouldStop) -> MotionResult:
        """Follow a trajectory to its end. When should_stop turns true the arm stops and holds."""


class GripperPort(Protocol):
    """Two fingers that move together."""

    def width(self) -> float:
        """Return the full distance between the fingers [m], from 0 to the hand's opening."""

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        """Move to a full width [m] with at most max_effort [N]; being stopped by an object is a success."""

    def stop(self) -> None:
        """Stop the fingers where they are."""
