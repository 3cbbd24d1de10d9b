"""What a person reads for phases, outcomes and states."""

from __future__ import annotations

from cliport_perception.policy_state import PolicyState
from cliport_perception.primitive import Outcome

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
    """Of a phase of the executor; an unknown one is said as it is."""
    return _PHASES.get(name, name.lower().replace("_", " "))


def outcome_words(outcome: int, executed: bool = True) -> str:
    """Of an outcome's number; an unknown one is said as it is."""
    if not executed:
        return "recorded without moving"
    return _OUTCOMES[Outcome(outcome)] if outcome in set(Outcome) else f"outcome {outcome}"


def policy_words(state: PolicyState, message: str) -> str:
    """Of the policy server's state."""
    name = state.name.lower().replace("_", " ")
    return f"{name}: {message}" if message else name


def verdict_words(success: bool | None) -> str:
    """Of an episode's mark."""
    return {True: "success", False: "failure", None: "not marked"}[success]
