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
    APPROVAL = 11
    RECOVERING = 12

    def progress(self, within: float = 0.0) -> float:
        """Return the share of the whole action that is done, 0..1, where `within` of this phase is.

        RECOVERING has no place in that order: whoever enters it knows what was done before.
        """
        if self is Phase.APPROVAL:
            return float(Phase.GO_ABOVE_PICK / Phase.DONE)
        return min((self + within) / Phase.DONE, 1.0)
