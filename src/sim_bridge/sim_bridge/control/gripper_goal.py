"""Goals of the hand, and what may be wrong with it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from sim_bridge.errors import SimBridgeError


class HandFault(Enum):
    """Faults that a hand may have.

    NEVER_HOMED: it aborts all but homing, which cures it; ABORTS: whatever it is told; LOST: that, too, and nobody
    learns where its fingers are.
    """

    NONE = ""
    NEVER_HOMED = "never_homed"
    ABORTS = "aborts"
    LOST = "lost"


class GripperGoalError(SimBridgeError):
    """A gripper goal that is not taken; the message carries the value and the valid range."""


class HandTask(Enum):
    """Ways to move the fingers: GripperCommand grasps where it closes and moves where it opens."""

    COMMAND = "GripperCommand"
    GRASP = "Grasp"
    MOVE = "Move"
    HOMING = "Homing"


@dataclass(frozen=True)
class GripperGoal:
    """A goal of the hand: `position` is HALF the wanted width [m]; `max_effort` [N], 0 for the default.

    speed [m/s] of the width, 0 for the hand's; epsilon: a grasp's own (inner, outer) [m].
    """

    position: float
    max_effort: float = 0.0
    task: HandTask = HandTask.COMMAND
    speed: float = 0.0
    epsilon: tuple[float, float] | None = None
