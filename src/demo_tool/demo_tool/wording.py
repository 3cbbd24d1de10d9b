"""Wording of phases, outcomes and states for a person."""

from __future__ import annotations

from cliport_core.outcome import Outcome
from cliport_core.policy_state import PolicyState

_PHASES = {
    "": "asking the arm",
    "VALIDATING": "checking the request",
    "GRASP_PLANNING": "planning the grasp and the way",
    "GO_ABOVE_PICK": "going above the pick",
    "DESCEND": "going down",
    "CLOSE": "closing the fingers",
    "RAISE": "raising",
    "CARRY": "carrying",
    "LOWER": "lowering",
    "OPEN": "opening the fingers",
    "RETREAT": "going back",
    "DONE": "done",
    "APPROVAL": "waiting for approval of the plan",
    "RECOVERING": "going back after a failure",
}
_OUTCOMES = {
    Outcome.SUCCEEDED: "succeeded",
    Outcome.PLANNED: "planned",
    Outcome.REJECTED: "refused by the arm",
    Outcome.PLANNING_FAILED: "no way found",
    Outcome.EXECUTION_FAILED: "failed on the way",
    Outcome.GRASP_MISSED: "the fingers closed on nothing",
    Outcome.DROPPED: "the object was lost on the way",
    Outcome.CANCELLED: "stopped on the way",
}


def phase_words(name: str) -> str:
    """Return the words for a phase of the executor; an unknown one's are its name."""
    return _PHASES.get(name, name.lower().replace("_", " "))


def outcome_words(outcome: Outcome) -> str:
    """Return the words for an outcome."""
    return _OUTCOMES[outcome]


def policy_words(state: PolicyState, message: str) -> str:
    """Return the words for the policy server's state and its message."""
    name = state.name.lower().replace("_", " ")
    return f"{name}: {message}" if message else name
