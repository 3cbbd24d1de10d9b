"""Substitutions of launch files: $(var x), $(find-pkg-share p), $(env X default) and their like."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ros2cli_small.errors import CommandError
from ros2cli_small.packages import find_executable, find_prefix, find_share

TRUE = ("true", "1")
FALSE = ("false", "0")


@dataclass(frozen=True)
class Scope:
    """Values that substitutions read: the launch configurations (arguments and lets) and the file they stand in."""

    configurations: Mapping[str, str]
    file: Path


def as_bool(text: str) -> bool:
    """Return the truth of a condition's text."""
    lowered = text.strip().lower()
    if lowered not in TRUE + FALSE:
        raise CommandError(f"invalid condition expression '{text}', expected one of {', '.join(TRUE + FALSE)}")
    return lowered in TRUE


def substitute(text: str, scope: Scope) -> str:
    """Return a text with every $(...) replaced. `\\$` stands for a dollar sign."""
    result = []
    position = 0
    while position < len(text):
        if text.startswith("\\$", position):
            result.append("$")
            position += 2
        elif text.startswith("$(", position):
            end = _closing(text, position + 2)
            result.append(_evaluate(text[position + 2 : end], scope))
            position = end + 1
        else:
            result.append(text[position])
            position += 1
    return "".join(result)


def _closing(text: str, start: int) -> int:
    """Return where the parenthesis closes that was opened before `start`."""
    depth, quote = 1, ""
    for position in range(start, len(text)):
        character = text[position]
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character == "(":
            depth += 1
        elif character == ")":
            depth -= 1
            if depth == 0:
                return position
    raise CommandError(f"substitution is not closed: '{text}'")


def _words(text: str) -> list[str]:
    """Split at blanks outside quotes and parentheses; outer quotes go."""
    words: list[str] = []
    current, depth, quote, started = "", 0, "", False
    for character in text:
        if depth == 0 and not quote and character.isspace():
            if started:
                words.append(current)
            current, started = "", False
            continue
        started = True
        if depth == 0 and character in "'\"" and quote in ("", character):
            quote = "" if quote else character
            continue
        depth += {"(": 1, ")": -1}.get(character, 0)
        current += character
    return [*words, current] if started else words


def _evaluate(expression: str, scope: Scope) -> str:
    words = _words(expression)
    if not words:
        raise CommandError("empty substitution '$()'")
    name, arguments = words[0], [substitute(word, scope) for word in words[1:]]
    low, high = _ARITY.get(name, (0, -1))
    if high < 0:
        raise CommandError(f"unknown substitution '{name}'; known here: {', '.join(_ARITY)}")
    if not low <= len(arguments) <= high:
        raise CommandError(f"substitution '$({expression})' takes {low} to {high} arguments, got {len(arguments)}")
    if name == "var":
        return _look_up("launch configuration", scope.configurations, arguments)
    if name == "env":
        return _look_up("environment variable", os.environ, arguments)
    if name in ("dirname", "filename"):
        return str(scope.file.parent) if name == "dirname" else scope.file.name
    if name == "find-pkg-share":
        return str(find_share(arguments[0]))
    if name == "find-pkg-prefix":
        return str(find_prefix(arguments[0]))
    if name == "exec-in-pkg":
        return str(find_executable(arguments[1], arguments[0]))
    return str(_logic(name, arguments)).lower()


def _look_up(kind: str, values: Mapping[str, str], arguments: list[str]) -> str:
    """Return the value of a name, or the default; arguments: the name and, optionally, a default."""
    name, *default = arguments
    if name in values:
        return values[name]
    if default:
        return default[0]
    raise CommandError(f"{kind} '{name}' does not exist")


_ARITY = {
    "var": (1, 2), "env": (1, 2), "dirname": (0, 0), "filename": (0, 0),
    "find-pkg-share": (1, 1), "find-pkg-prefix": (1, 1), "exec-in-pkg": (2, 2),
    "not": (1, 1), "and": (2, 2), "or": (2, 2), "equals": (2, 2), "not-equals": (2, 2),
}  # fmt: skip


def _logic(name: str, arguments: list[str]) -> bool:
    if name == "not":
        return not as_bool(arguments[0])
    if name in ("equals", "not-equals"):
        return (arguments[0] == arguments[1]) == (name == "equals")
    first, second = as_bool(arguments[0]), as_bool(arguments[1])
    return (first and second) if name == "and" else (first or second)
