"""The end of an action: its outcome, and what is reported of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Outcome(IntEnum):
    """The ways in which a request can end; values as in the PickPlace action."""

    SUCCEEDED = 0
    PLANNED = 1
    REJECTED = 2
    PLANNING_FAILED = 3
    EXECUTION_FAILED = 4
    GRASP_MISSED = 5
    DROPPED = 6
    CANCELLED = 7

    @property
    def label(self) -> str:
        """The name in words: "grasp missed"."""
        return self.name.lower().replace("_", " ")

    @property
    def is_success(self) -> bool:
        """True if the request was carried out or, where only a plan was asked for, planned."""
        return self in (Outcome.SUCCEEDED, Outcome.PLANNED)

    @classmethod
    def from_number(cls, number: int) -> Outcome:
        """Return the outcome that a message or a bag names; an unknown one counts as a failed execution."""
        try:
            return cls(number)
        except ValueError:
            return cls.EXECUTION_FAILED


@dataclass(frozen=True)
class ActionResult:
    """The end of an action.

    message: one line for a person.
    grasp_centroid: (x, y, z) [m, base frame] of what was grasped; None where nothing was.
    gripper_width: between the fingers after closing [m].
    """

    outcome: Outcome
    message: str
    grasp_centroid: tuple[float, float, float] | None = None
    gripper_width: float = 0.0
