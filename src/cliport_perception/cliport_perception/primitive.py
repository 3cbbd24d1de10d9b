"""What the arm can do with two poses, and how it ends."""

from __future__ import annotations

from enum import IntEnum


class Primitive(IntEnum):
    """Values as in the PickPlace action."""

    PICK_PLACE = 0
    SWEEP = 1
    FOLD = 2


class Outcome(IntEnum):
    """How a request ended; values as in the PickPlace action."""

    SUCCEEDED = 0
    PLANNED = 1
    REJECTED = 2
    PLANNING_FAILED = 3
    EXECUTION_FAILED = 4
    GRASP_MISSED = 5
    DROPPED = 6
    CANCELLED = 7
