"""Sentences of the policy server for a person."""

from __future__ import annotations

from cliport_core import topics

STOPPED = f"stopped: call {topics.RESUME} to go on"
NOT_TOLD = f"the arm was not told: {topics.EXECUTOR_STOP} is not there; use its own stop if it moves"
NOT_RESUMED = f"the executor was not told: {topics.EXECUTOR_RESUME} is not there; call that one when it is"
_SHOWN = 60  # characters of what is no instruction


def ended_words(instruction: str, was_busy: bool) -> str:
    """Return what an instruction to stop did; instruction: as it was said, maybe empty."""
    if was_busy:
        return f"stopped by the instruction '{instruction}'" if instruction else "stopped by an empty instruction"
    said = f"'{instruction}'" if instruction else "empty"
    return f"nothing to do: the instruction is {said}"


def unseen_words(seconds: float, complaint: str) -> str:
    """Return why there is nothing to act on after so long a wait; complaint: of perception, maybe empty."""
    why = one_line(complaint) or f"is the camera running? (topic {topics.HEIGHTMAP})"
    return f"no fresh heightmap for {seconds:.1f} s: {why}"


def excerpt(text: str) -> str:
    """Return the beginning of a text on one line."""
    return one_line(text[:_SHOWN]) + "..." if len(text) > _SHOWN else one_line(text)


def one_line(text: str) -> str:
    """Return printable text without line breaks or doubled blanks: it goes into logs and messages."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
