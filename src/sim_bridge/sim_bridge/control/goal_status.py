"""Status of an action goal."""

from __future__ import annotations

from enum import Enum


class GoalStatus(Enum):
    """States of a goal that a controller has taken. CANCELING lasts while the arm brakes."""

    EXECUTING = "executing"
    CANCELING = "canceling"
    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"

    @property
    def final(self) -> bool:
        """True if the goal has ended."""
        return self not in (GoalStatus.EXECUTING, GoalStatus.CANCELING)
