"""The phases that an action goes through."""

from __future__ import annotations

from enum import IntEnum


class Phase(IntEnum):
    """A phase of an action; values as in the PickPlace action."""

    VALIDATING = 0
    GRASP_PLANNING = 1
    GO_ABOVE_PICK = 2
    DESCEND = 3
    CLOSE = 4
    RAISE = 5
    CARRY = 6
    LOWER = 7
    OPEN = 8
    RETREAT = 9
    DONE = 10
