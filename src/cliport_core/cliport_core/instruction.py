"""Rules for an instruction, which the policy server, the page, bags and scenes share."""

from __future__ import annotations

import unicodedata

from cliport_core.errors import InstructionError

MAX_INSTRUCTION = 500  # characters
# Words that say no more beside "stop".
_STOPPABLE = ("", "please", "now", "it", "that", "the", "arm", "robot", "motion", "moving", "everything", "immediately")
_JOINERS = "\u200c\u200d"  # spelling in Persian, Hindi and others needs them
_UNPRINTABLE = {"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"}


def asks_to_stop(instruction: str) -> bool:
    """Return True for an empty instruction and for one that says no more than stop, halt or cancel."""
    words = [word.strip(".,!").lower() for word in instruction.split()]
    said = [word for word in words if word not in _STOPPABLE]
    return not words or (bool(said) and all(word in ("stop", "halt", "cancel") for word in said))


def normalized_instruction(text: str) -> str:
    """Return an instruction in any script as one line with single blanks; an empty one means: stop.

    Line breaks, tabs and all other white space count as a blank.

    Raises:
        InstructionError: when it is longer than `MAX_INSTRUCTION`, or holds what cannot be printed.
    """
    plain = " ".join(text.split())
    if len(plain) > MAX_INSTRUCTION:
        raise InstructionError(
            f"the instruction has {len(plain)} characters: at most {MAX_INSTRUCTION} are taken, so shorten it"
        )
    for character in plain:
        if unicodedata.category(character) in _UNPRINTABLE and character not in _JOINERS:
            raise InstructionError(f"the instruction holds U+{ord(character):04X}, which cannot be printed: remove it")
    return plain
