"""What the policy server does."""

from __future__ import annotations

from enum import IntEnum


class PolicyState(IntEnum):
    """Values as in the PolicyStatus message."""

    IDLE = 0
    OBSERVING = 1
    PROPOSING = 2
    WAITING_FOR_APPROVAL = 3
    EXECUTING = 4
    DONE = 5
    FAILED = 6
