"""Checks of text that comes from outside and is stored: names of folders, and instructions."""

from __future__ import annotations

import re

from cliport_core import errors as core_errors
from cliport_core.instruction import normalized_instruction
from cliport_episodes.errors import BadNameError, InstructionError

_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}", re.ASCII)


def check_name(what: str, name: str) -> str:
    """Return a name if it is one component of a path and no hidden file; `what`: the named thing, for the error.

    Raises:
        BadNameError: when it is not.
    """
    if not _NAME.fullmatch(name):
        raise BadNameError(what, name)
    return name


def check_instruction(text: str) -> str:
    """Return an instruction as it is stored: one line, in any script.

    Raises:
        InstructionError: when it is empty, or `normalized_instruction` refuses it.
    """
    try:
        plain = normalized_instruction(text)
    except core_errors.InstructionError as error:
        raise InstructionError(str(error)) from None
    if not plain:
        raise InstructionError("the instruction is empty: say in words what is to be done")
    return plain
