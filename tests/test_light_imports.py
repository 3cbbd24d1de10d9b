"""Commands that read or write data start without torch, whose import alone takes seconds."""

from __future__ import annotations

import ast
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from house import Module, imports, modules

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = (
    *("record_cli", "generate_cli", "evaluate_cli", "evaluate_graph", "gallery_cli"),
    *("results", "card_scores", "worst_cli", "experiment_cli", "understanding_cli"),
)


@pytest.mark.parametrize("command", COMMANDS)
def test_no_network_is_imported_before_it_is_asked_for(command: str) -> None:
    known = imported_at_once()
    reached = reached_from(f"cliport_benchmark.{command}", known)
    assert "cliport_policy.errors" in reached or command == "record_cli"
    heavy = sorted(name for name in reached if "torch" in outside(known[name]))
    assert not heavy


def test_a_policy_does_import_it() -> None:
    known = imported_at_once()
    assert "torch" in outside(known["cliport_policy.policy"])
    assert "cliport_policy.networks.factory" in reached_from("cliport_policy.policy", known)


@cache
def imported_at_once() -> dict[str, Module]:
    return {name: at_once(module) for name, module in modules(ROOT).items()}


def at_once(module: Module) -> Module:
    """Return a module's imports alone, without those inside functions or for types."""
    body = [node for node in module.tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    return replace(module, tree=ast.Module(body=list(body), type_ignores=[]))


def reached_from(start: str, known: dict[str, Module]) -> set[str]:
    """Name the modules that importing one imports, the packages around each among them."""
    reached: set[str] = set()
    waiting = {start}
    while waiting:
        name = waiting.pop()
        reached.add(name)
        parts = name.split(".")
        around = {".".join(parts[:n]) for n in range(1, len(parts))} & set(known)
        waiting |= (imports(known[name], known) | around) - reached
    return reached


def outside(module: Module) -> set[str]:
    """Name the packages that a module imports, by their first names."""
    found = set()
    for node in module.tree.body:
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module.split(".")[0])
    return found
