"""Finds the block's and the bowl's colour in a sentence, for a scene that has them.

This sets scenes up; it never reaches the policy, which reads the sentence itself.
"""

from __future__ import annotations

import re

from cliport_core.errors import InstructionError
from cliport_core.instruction import normalized_instruction
from sim_bridge.colors import COLORS
from sim_bridge.errors import GoalError
from sim_bridge.tasks.color_goal import ColorGoal

_SPELLINGS = {name: name for name in COLORS} | {"grey": "gray"}
_BLOCKS = {"block", "cube", "brick", "box", "dice", "die", "piece", "toy"}
_BOWLS = {"bowl", "dish", "container", "cup", "basin", "pot", "vessel", "plate", "tray"}


def goal_colors(sentence: str) -> ColorGoal:
    """Return the goal that a sentence names.

    A thing's colour is the last colour before its noun that belongs to no other noun; where there is none,
    the first one after it ("the cubes that are red").

    Raises:
        GoalError: when a colour is missing or both are the same, or the sentence is no instruction.
    """
    try:
        words = re.findall(r"[a-z]+", normalized_instruction(sentence).lower())
    except InstructionError as error:
        raise GoalError(str(error)) from None
    marks = [(_kind(word), _SPELLINGS.get(word)) for word in words]
    marks = [m for m in marks if m[0] or m[1]]
    found: dict[str, str] = {}
    taken: set[int] = set()
    for at, (kind, _) in enumerate(marks):
        if kind and kind not in found and at > 0 and marks[at - 1][1] and at - 1 not in taken:
            found[kind] = str(marks[at - 1][1])
            taken.add(at - 1)
    for at, (kind, _) in enumerate(marks):
        if kind and kind not in found and at + 1 < len(marks) and marks[at + 1][1] and at + 1 not in taken:
            found[kind] = str(marks[at + 1][1])
            taken.add(at + 1)
    if "block" not in found or "bowl" not in found:
        raise GoalError(
            "the instruction names no "
            + " and no ".join(f"{kind} colour" for kind in ("block", "bowl") if kind not in found)
            + f"; say for example 'put the red blocks in a green bowl' with two of {', '.join(COLORS)}"
        )
    return ColorGoal(found["block"], found["bowl"])


def _kind(word: str) -> str | None:
    """Return "block" or "bowl" if the word, singular or plural, means one."""
    forms = {word, word.removesuffix("s"), word.removesuffix("es")}
    if forms & _BLOCKS:
        return "block"
    return "bowl" if forms & _BOWLS else None
