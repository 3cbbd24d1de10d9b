"""The policy server's states, and the status that it publishes."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from cliport_core.action import Primitive


class PolicyState(IntEnum):
    """States of the policy server; values as in the PolicyStatus message."""

    IDLE = 0
    OBSERVING = 1
    PROPOSING = 2
    WAITING_FOR_APPROVAL = 3
    EXECUTING = 4
    DONE = 5
    FAILED = 6


class ServerStatus(NamedTuple):
    """The policy server's status as published; step counts the actions begun for the instruction.

    confidence, primitive: of the action that waits for approval or is executed; in other states None and PICK_PLACE,
    and confidence is None where it is not known, too. proposal_id: of the proposal, or of the
    executor's plan, that waits for approval; "" where none does.
    """

    state: PolicyState
    message: str
    instruction: str
    step: int = 0
    confidence: float | None = None
    primitive: Primitive = Primitive.PICK_PLACE
    proposal_id: str = ""
