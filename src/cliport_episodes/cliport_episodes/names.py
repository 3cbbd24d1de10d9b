"""What comes from outside: names that become folders, and instructions."""

from __future__ import annotations

import re
import unicodedata

from cliport_episodes.errors import BadNameError, InstructionError

MAX_INSTRUCTION = 500  # characters
_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}", re.ASCII)
_JOINERS = "\u200c\u200d"  # spelling in Persian, Hindi and others needs them
_UNPRINTABLE = {"Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp"}


def check_name(what: str, name: str) -> str:
    """Return a name that is one component of a path and no hidden file; `what` it names is said in the error.

    Raises:
        BadNameError: for any other.
    """
    if not _NAME.fullmatch(name):
        raise BadNameError(what, name)
    return name


def check_instruction(text: str) -> str:
    """Return an instruction without spaces around it, in any script.

    Raises:
        InstructionError: when it is empty, longer than `MAX_INSTRUCTION`, or holds what cannot be printed.
    """
    plain = text.strip()
    if not plain:
        raise InstructionError("the instruction is empty: say in words what is to be done")
    if len(plain) > MAX_INSTRUCTION:
        raise InstructionError(
            f"the instruction has {len(plain)} characters: at most {MAX_INSTRUCTION} are stored, so shorten it"
        )
    for character in plain:
        if unicodedata.category(character) in _UNPRINTABLE and character not in _JOINERS:
            raise InstructionError(f"the instruction holds U+{ord(character):04X}, which cannot be printed: remove it")
    return plain
