"""Sentences of the policy server for a person."""

from __future__ import annotations

from cliport_core import topics
from cliport_policy.presence.kinds import is_called
from cliport_policy.server.types import Answer

STOPPED = f"stopped: call {topics.RESUME} to go on"
NOT_TOLD = f"the arm was not told: {topics.EXECUTOR_STOP} is not there; use its own stop if it moves"
NOT_RESUMED = f"the executor was not told: {topics.EXECUTOR_RESUME} is not there; call that one when it is"
STOP_UNHEARD = "the executor did not answer; the arm may still move: use its own stop"
RESUME_UNHEARD = f"the executor did not answer: it may still be stopped; call {topics.EXECUTOR_RESUME} when it does"
APPROVAL_UNHEARD = "the executor did not answer: whether it runs the plan is not known"
_SHOWN = 60  # characters of what is no instruction


def stop_answer(confirmed: Answer | None) -> Answer:
    """Return what to say to who asked for a stop. confirmed: the executor's answer to its own; None: it gave none."""
    if confirmed is None:
        return Answer(False, f"{STOPPED}; but {STOP_UNHEARD}")
    if not confirmed.success:
        return Answer(False, f"{STOPPED}; but the executor says: {one_line(confirmed.message)}")
    return Answer(True, STOPPED)


def ended_words(instruction: str, was_busy: bool) -> str:
    """Return what an instruction to stop did; instruction: as it was said, maybe empty."""
    if was_busy:
        return f"stopped by the instruction '{instruction}'" if instruction else "stopped by an empty instruction"
    said = f"'{instruction}'" if instruction else "empty"
    return f"nothing to do: the instruction is {said}"


def refused_words(why: str, was_busy: bool) -> str:
    """Return why an instruction is not acted on, and what it ended all the same."""
    return f"what went on was stopped: {why}" if was_busy else why


def unseen_words(seconds: float, complaint: str) -> str:
    """Return why there is nothing to act on after so long a wait; complaint: of perception, maybe empty."""
    why = one_line(complaint) or f"is the camera running? (topic {topics.HEIGHTMAP})"
    return f"no fresh heightmap for {seconds:.1f} s: {why}"


def absent_words(instruction: str, missing: str) -> str:
    """Return that what an instruction names is not there. missing: what that is, such as "purple bowl", maybe empty.

    Where the instruction has no word of it, as "pick up the gray block" names no place, the policy guessed it.
    """
    if not missing:
        return f"what '{instruction}' names is not to be seen"
    if any(is_called(word, instruction) for word in missing.lower().split() if word != "or"):
        return f"no {missing} is to be seen"
    thing = f"{'an' if missing[0] in 'aeiou' else 'a'} {missing}"
    return f"'{instruction}' was taken to name {thing}, and none is to be seen: say what to pick and where to put it"


def excerpt(text: str) -> str:
    """Return the beginning of a text on one line."""
    return one_line(text[:_SHOWN]) + "..." if len(text) > _SHOWN else one_line(text)


def one_line(text: str) -> str:
    """Return printable text without line breaks or doubled blanks: it goes into logs and messages."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
