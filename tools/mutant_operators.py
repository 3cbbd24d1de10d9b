"""Mutations that cosmic-ray lacks: a statement that is forgotten, as a cancel that is never sent."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from cosmic_ray.operators.operator import Example, Operator
from cosmic_ray.plugins import OPERATOR_PROVIDERS
from parso.python.tree import Keyword


class RemoveStatement(Operator):
    """Leaves out a call whose value is not used, or an assignment to an attribute or an element."""

    def mutation_positions(self, node: Any) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        """Begin and end (line, column) of the statement."""
        if node.type != "simple_stmt":
            return
        statement = node.children[0]
        target = statement.children[0] if statement.type == "expr_stmt" else statement
        if target.type in ("atom_expr", "power"):
            yield statement.start_pos, statement.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        """The line with `pass` in the statement's place."""
        statement = node.children[0]
        node.children[0] = Keyword("pass", statement.start_pos, statement.get_first_leaf().prefix)
        return node

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        """See Operator."""
        return (Example("handle.cancel()\n", "pass\n"), Example("self.x[0] = 1\n", "pass\n"))


def register() -> None:
    """Add these operators to cosmic-ray's."""
    OPERATOR_PROVIDERS["own"] = {"RemoveStatement": RemoveStatement}
