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


class Refusal(IntEnum):
    """The reasons for which a request is refused, or its motion ended early; values as in the PickPlace action."""

    NONE = 0
    MALFORMED = 1
    OUTSIDE_WORKSPACE = 2
    OUT_OF_REACH = 3
    NO_CLOUD = 4
    OLD_CLOUD = 5
    FUTURE_CLOUD = 6
    NO_CAMERA_POSE = 7
    JOINT_STATES = 8
    TABLE_HEIGHT = 9
    HAND_NOT_EMPTY = 10
    NOT_APPROVED = 11
    OWNER_SILENT = 12
    NO_OWNER = 13
    NO_GUARD = 14

    @classmethod
    def from_number(cls, number: int) -> Refusal:
        """Return the refusal that a message names; an unknown one counts as a malformed request."""
        try:
            return cls(number)
        except ValueError:
            return cls.MALFORMED


@dataclass(frozen=True)
class ActionResult:
    """The end of an action.

    message: one line for a person.
    refusal: why it was refused; refusal_value, refusal_limit: what was found and what would have been allowed, in SI
    units, None where there is no such number.
    grasp_centroid: (x, y, z) [m, base frame] of what was grasped; None where nothing was.
    gripper_width: between the fingers after closing [m].
    """

    outcome: Outcome
    message: str
    grasp_centroid: tuple[float, float, float] | None = None
    gripper_width: float = 0.0
    refusal: Refusal = Refusal.NONE
    refusal_value: float | None = None
    refusal_limit: float | None = None
