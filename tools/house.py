"""Measure how the source is built, for one tree or for two side by side.

    python tools/house.py [TREE ...]        by default the tree that this file is in; prints a Markdown table

Counted are the modules of src, examples and tools without tests. A circle is a set of modules that import each
other, however late; importing a package counts as importing its __init__. An action's type is a class with fields
`pick` and `place` that hold poses, or with an outcome and a gripper's width. A hand's dimension is a number other
than 0 that is bound to a name with finger, jaw, palm, opening or the like in it (but for frictions and margins),
outside the package that states the hand. The files to touch are those in the first table of docs/new-*.md.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOTS = ("src", "examples", "tools")
LONG_FILE, LONG_FUNCTION = 300, 40  # lines
# A name of a constant, field or argument that would state a dimension of the hand, or a bound of it.
HAND = re.compile(r"finger|jaw|palm|opening|gripper_width|max_width|hand_(half|width|depth|length)|tcp_in|widest")
# What such names say beside dimensions: margins about the hand are the business of whoever keeps them.
NO_DIMENSION = re.compile(r"margin|clearance|friction|force|fingerprint|words|period|max_width_px|height")
HAND_PACKAGE = "panda_model"
TOPIC = re.compile(r"^/(cliport|camera|panda_executor|sim_bridge|demo_tool|tf|tf_static|joint_states|points)(/|$)")
TOPIC_MODULE = "cliport_core.topics"
CHANGES = {"task": "new-task.md", "network": "new-network.md", "camera": "new-camera.md", "arm": "new-arm.md"}
TABLE = re.compile(r"^\| file \|.*\n\|[-|]+\n((?:\|.*\n)+)", re.MULTILINE)  # in docs/new-*.md: the files to touch


@dataclass(frozen=True)
class Module:
    """One source file: its dotted name, its lines and its syntax."""

    name: str
    path: Path
    lines: int
    tree: ast.Module


def modules(tree: Path) -> dict[str, Module]:
    """Read the modules of a tree, by dotted name."""
    found = {}
    for path in sorted(path for root in ROOTS for path in (tree / root).rglob("*.py")):
        parts = path.relative_to(tree).parts
        if {"test", "tests", "node_modules"} & set(parts) or path.name == "setup.py":
            continue
        name = _dotted(path, tree)
        text = path.read_text(encoding="utf-8")
        found[name] = Module(name, path, len(text.splitlines()), ast.parse(text))
    return found


def _dotted(path: Path, tree: Path) -> str:
    """Name a file as it is imported: from the topmost folder that has an __init__.py."""
    top = path.parent
    while (top / "__init__.py").exists() and top != tree:
        top = top.parent
    parts = path.relative_to(top).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports(module: Module, known: Mapping[str, Module]) -> set[str]:
    """Name the known modules that a module imports, anywhere in it."""
    is_package = module.path.name == "__init__.py"
    found = set()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = _absolute(node, module.name, is_package)
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                found.add(inner if inner in known else base)
    return {name for name in found if name in known and name != module.name}


def _absolute(node: ast.ImportFrom, name: str, is_package: bool) -> str:
    if not node.level:
        return node.module or ""
    parts = name.split(".")
    parts = parts[: len(parts) - node.level + is_package]
    return ".".join([*parts, node.module] if node.module else parts)


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Find the sets of modules that reach each other, largest first (Tarjan 1972, without recursion)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    on_stack: set[str] = set()
    stack: list[str] = []
    found = []
    for start in graph:
        work = [(start, iter(sorted(graph[start])))] if start not in index else []
        while work:
            name, rest = work[-1]
            if name not in index:
                index[name] = low[name] = len(index)
                stack.append(name)
                on_stack.add(name)
            for other in rest:
                if other not in index:
                    work.append((other, iter(sorted(graph[other]))))
                    break
                if other in on_stack:
                    low[name] = min(low[name], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[name])
                if low[name] == index[name]:
                    at = stack.index(name)
                    on_stack -= set(stack[at:])
                    found.append(sorted(stack[at:]))
                    del stack[at:]
    return sorted((circle for circle in found if len(circle) > 1), key=len, reverse=True)


def action_types(module: Module) -> Iterator[str]:
    """Name the classes for what is to be done and for how it ended."""
    for node in ast.walk(module.tree):
        if isinstance(node, ast.ClassDef):
            fields = {
                item.target.id: ast.unparse(item.annotation)
                for item in node.body
                if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)
            }
            poses = all("PlanarPose" in fields.get(end, "") for end in ("pick", "place"))
            ending = "outcome" in fields and "gripper_width" in fields
            if poses or ending:
                yield f"{module.name}.{node.name}"


def hand_dimensions(module: Module) -> Iterator[str]:
    """Name the numbers of the hand that a module states by itself."""
    if module.name.split(".")[0] == HAND_PACKAGE:
        return
    for node in ast.walk(module.tree):
        targets: list[ast.expr]
        if isinstance(node, ast.AnnAssign):
            targets = [node.target]
        elif isinstance(node, ast.Assign):
            targets = node.targets
        else:
            continue
        value = node.value.value if isinstance(node.value, ast.Constant) else None
        is_number = isinstance(value, float) and value != 0.0
        for target in targets:
            if is_number and isinstance(target, ast.Name) and is_hand(target.id):
                yield f"{module.name}.{target.id}"


def is_hand(name: str) -> bool:
    """Return whether a name is that of a dimension of the hand."""
    return bool(HAND.search(name.lower())) and not NO_DIMENSION.search(name.lower())


def topic_literals(module: Module) -> Iterator[str]:
    """Name the topics and services that a module writes out."""
    if module.name == TOPIC_MODULE:
        return
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and TOPIC.match(node.value):
            yield f"{module.name}: {node.value}"


def long_functions(module: Module) -> Iterator[str]:
    """Name the functions of more than LONG_FUNCTION lines."""
    for node in ast.walk(module.tree):
        if not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            continue
        if (node.end_lineno or 0) - node.lineno + 1 > LONG_FUNCTION:
            yield f"{module.name}.{node.name}"


def files_to_touch(tree: Path, document: str) -> str:
    """Count the files that a document of docs/ lists for one change; "-" where there is none."""
    path = tree / "docs" / document
    if not path.exists():
        return "-"
    first = TABLE.search(path.read_text(encoding="utf-8"))
    return str(len(first[1].splitlines())) if first else "?"


def measures(tree: Path) -> dict[str, str]:
    """Measure one tree: what is counted, and the count as text."""
    known = modules(tree)
    found = circles({name: imports(module, known) for name, module in known.items()})
    counts = {
        "modules": str(len(known)),
        "lines": str(sum(module.lines for module in known.values())),
        f"files over {LONG_FILE} lines": str(sum(module.lines > LONG_FILE for module in known.values())),
        f"functions over {LONG_FUNCTION} lines": _count(known, long_functions),
        "circles (modules in them)": f"{len(found)} ({sum(map(len, found))})",
        "types for an action and its end": _count(known, action_types),
        "names that state a dimension of the hand": _count(known, hand_dimensions),
        "topics and services written as literals": _count(known, topic_literals),
    }
    for change, document in CHANGES.items():
        counts[f"files to touch for a new {change}"] = files_to_touch(tree, document)
    return counts


def _count(known: Mapping[str, Module], find: Callable[[Module], Iterator[str]]) -> str:
    return str(sum(len(list(find(module))) for module in known.values()))


def main(arguments: list[str]) -> int:
    """Print the table; with --list also what was counted in the last tree."""
    names = [name for name in arguments if name != "--list"]
    trees = [Path(name).resolve() for name in names] or [Path(__file__).resolve().parents[1]]
    columns = [measures(tree) for tree in trees]
    print("| | " + " | ".join(names or ["here"]) + " |")
    print("|---|" + "---|" * len(columns))
    for key in columns[0]:
        print(f"| {key} | " + " | ".join(column[key] for column in columns) + " |")
    if "--list" in arguments:
        known = modules(trees[-1])
        for find in (long_functions, action_types, hand_dimensions, topic_literals):
            print(f"\n{find.__name__}:", *(item for module in known.values() for item in find(module)), sep="\n  ")
        for circle in circles({name: imports(module, known) for name, module in known.items()}):
            print("\ncircle:", *circle, sep="\n  ")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
