"""The arm under test, as the checks see it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from panda_driver.conformance.plan import MotionPlan
from panda_model import ArmModel
from panda_model.limits import FloatArray


@dataclass(frozen=True, eq=False)
class Sample:
    """One joint state: its stamp and when it came [s, ROS time], positions (7,) [rad], fingers (2,) [m]."""

    stamp: float
    came: float
    arm: FloatArray
    fingers: FloatArray


class End(Enum):
    """Ways in which a goal can end."""

    REJECTED = "rejected"
    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"


class RunningGoal(Protocol):
    """A goal that was sent. `end` is None while it runs; accepted: None before the server's answer."""

    accepted: bool | None
    end: End | None
    ended_at: float  # [s, ROS time]
    words: str  # of the arm's result
    width: float  # of the gripper's result, as it is reported [m]
    stalled: bool

    def cancel(self) -> None:
        """Ask for its end."""
        ...


@dataclass(frozen=True)
class Bounds:
    """Limits of what counts as right.

    rate: of the joint states at least [Hz]; age: of a state at most [s]; path: from the path at most [rad]; patience:
    times longer than asked a motion may take, for a simulator that is slower than real time; spare: for answers and for
    starting [s]; cancel: from a cancel to its end [s]; settle: from there to a standstill [s]; still: what counts as
    standing still [rad]; width: between what the gripper says and what the joint states show [m]; duration, amount: of
    the motions [s, rad].
    """

    rate: float = 25.0
    age: float = 0.25
    path: float = 0.02
    patience: float = 1.5
    spare: float = 1.0
    cancel: float = 1.0
    settle: float = 0.25
    still: float = 0.004
    width: float = 0.004
    duration: float = 2.0
    amount: float = 0.08


class Subject(Protocol):
    """The arm under test."""

    robot: ArmModel
    bounds: Bounds

    def now(self) -> float:
        """Return the time [s, ROS time]."""
        ...

    def samples(self, since: float) -> list[Sample]:
        """Return the joint states that came from `since` on [s, ROS time]."""
        ...

    def wait(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait for a condition, for at most so long [s, wall clock]; return whether it came."""
        ...

    def follow(self, joints: Sequence[str], plan: MotionPlan) -> RunningGoal:
        """Send a trajectory."""
        ...

    def grip(self, position: float, effort: float) -> RunningGoal:
        """Send a gripper goal: half a width [m]."""
        ...
