"""Docstrings say what they describe in words that stand alone: they begin with a verb or a noun phrase.

Ruff's D rules see that docstrings exist and how they are laid out; this sees how they begin.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src"
# Packages whose docstrings are held to the rules; a package joins once it is rewritten.
COMPLIANT = (
    "cliport_benchmark",
    "cliport_core",
    "cliport_episodes",
    "cliport_perception",
    "cliport_policy",
    "demo_tool",
    "panda_driver",
    "panda_executor",
    "panda_model",
    "sim_bridge",
)
# Words that continue a sentence which the name has begun, or that make a riddle of it.
BANNED_OPENERS = {
    "about", "also", "among", "and", "as", "at", "because", "before", "behind", "below", "between", "but", "by",
    "during", "either", "for", "from", "how", "if", "in", "into", "its", "like", "neither", "nor", "of", "on", "once",
    "or", "over", "so", "such", "than", "that", "their", "then", "these", "they", "those", "though", "through", "to",
    "under", "until", "upon", "what", "when", "where", "whether", "which", "while", "who", "whose", "why", "with",
    "within", "without",
}  # fmt: skip
# Verbs that a function which returns something may begin with; the list grows with the packages.
VERBS = {
    "add", "answer", "apply", "ask", "begin", "call", "change", "check", "compare", "convert", "correlate", "count",
    "create", "cut", "declare", "decode", "descend", "deserialize", "discard", "double", "draw", "drop", "encode",
    "end", "execute", "find", "fit", "follow", "forget", "give", "hand", "index", "invert", "join", "judge", "let",
    "listen", "load", "lock", "make", "mark", "measure", "merge", "move", "note", "open", "parse", "plan", "poll",
    "put", "read", "record", "refuse", "remove", "replace", "report", "resize", "restore", "return", "reword",
    "run", "save", "score", "send", "serialize", "shift", "show", "solve", "spin", "split", "stack", "start",
    "stop", "take", "time", "turn", "wait", "watch", "write", "yield",
}  # fmt: skip
# A shape or an argument in place of words: "(B, T) -> ...", "x: (B, C)".
SHAPE = re.compile(r"^(\(|-> |[a-z]\w*(, \w+)*: )")


class Documented(NamedTuple):
    """Public module, class or function; returns: a function that hands something back."""

    name: str
    docstring: str | None
    returns: bool


def _hands_back(node: ast.AST) -> bool:
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or node.returns is None:
        return False
    return not (isinstance(node.returns, ast.Constant) and node.returns.value is None)


def _is_property(node: ast.AST) -> bool:
    decorators = getattr(node, "decorator_list", [])
    return any(ast.unparse(decorator).endswith("property") for decorator in decorators)


def _public(node: ast.AST, prefix: str) -> Iterator[Documented]:
    """Yield what is public in a module or class; functions within functions are nobody's to call."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If | ast.Try | ast.With):
            yield from _public(child, prefix)
        elif isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if child.name.startswith("_"):
                continue
            name = f"{prefix}.{child.name}"
            yield Documented(name, ast.get_docstring(child), _hands_back(child) and not _is_property(child))
            if isinstance(child, ast.ClassDef):
                yield from _public(child, name)


def _documented(source: str) -> list[Documented]:
    tree = ast.parse(source)
    return [Documented("module", ast.get_docstring(tree), False), *_public(tree, "module")]


def _complaint(entry: Documented) -> str | None:
    if not entry.docstring:
        return "has no docstring"
    summary = entry.docstring.splitlines()[0]
    if SHAPE.match(summary):
        return f"begins with a shape or an argument: {summary!r}"
    first = re.split(r"[^\w'-]", summary.lstrip("`\"'("), maxsplit=1)[0]
    if first.lower() in BANNED_OPENERS:
        return f"begins with {first!r}, which does not stand alone: {summary!r}"
    if entry.returns and first.lower() not in VERBS:
        return f"begins with {first!r}, not with a verb of VERBS: {summary!r}"
    return None


def _complaints(source: str) -> list[str]:
    found = [(entry.name, _complaint(entry)) for entry in _documented(source)]
    return [f"{name} {words}" for name, words in found if words is not None]


@pytest.mark.parametrize("package", COMPLIANT)
def test_docstrings_stand_alone(package: str) -> None:
    complaints: list[str] = []
    files = sorted((SOURCE / package / package).rglob("*.py"))
    for path in files:
        found = _complaints(path.read_text(encoding="utf-8"))
        complaints += [f"{path.relative_to(SOURCE)}: {complaint}" for complaint in found]
    assert files
    assert not complaints, "\n".join(complaints)


@pytest.mark.parametrize(
    ("docstring", "complains"),
    [
        ("Of the activity.", True),
        ("What lies on the table.", True),
        ("(B, T) -> (B, D).", True),
        ("x: (B, C, H, W).", True),
        ("Whether it moves.", True),
        ("The episodes of a data set.", True),
        ("Episodes of a data set.", True),
        ("Return the episodes of a data set.", False),
        ("Cut windows of the maps.", False),
    ],
)
def test_openers_are_told_apart(docstring: str, complains: bool) -> None:
    source = f'"""Module of one function."""\n\ndef name() -> int:\n    """{docstring}"""\n    return 1\n'
    assert bool(_complaints(source)) is complains


def test_public_names_are_found() -> None:
    source = """
def _private() -> int: ...

class Name:
    def act(self) -> None: ...
    @property
    def size(self) -> int:
        'The size.'
"""
    names = ["module", "module.Name", "module.Name.act"]
    assert _complaints(source) == [f"{name} has no docstring" for name in names]
