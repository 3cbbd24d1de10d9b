"""Names of the graph are stated in one module."""

import ast
import re
from pathlib import Path

import pytest

from cliport_core import topics

SOURCE = Path(__file__).resolve().parents[2]
MODULES = sorted(
    path
    for path in SOURCE.glob("*/*/**/*.py")
    if path.parts[-2] != "test" and "test" not in path.relative_to(SOURCE).parts and path.name != "topics.py"
)
GROUPS = re.compile(r"(?<![\w/.])/(cliport|panda_executor|sim_bridge|camera)/\w")


def _stated() -> set[str]:
    """Every name of the graph."""
    found: set[str] = set()
    for key, value in vars(topics).items():
        if key.isupper():
            values = value.values() if isinstance(value, dict) else [value]
            found |= {name for name in values if isinstance(name, str) and name.startswith("/")}
    return found


def _strings(source: str) -> list[str]:
    """Return the string constants of a module, parts of f-strings too, without its docstrings."""
    tree = ast.parse(source)
    docstrings = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                docstrings.add(id(first.value))
    constants = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return [node.value for node in constants if isinstance(node.value, str) and id(node) not in docstrings]


def _literals(source: str) -> list[str]:
    names = _stated()
    return [text for text in _strings(source) if text in names or GROUPS.search(text)]


def test_every_name_is_absolute_and_no_two_are_the_same() -> None:
    values = [v for k, v in vars(topics).items() if k.isupper() and isinstance(v, str) and v.startswith("/")]
    assert len(values) > 20 and len(set(values)) == len(values)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(SOURCE)))
def test_no_other_module_states_a_name_of_the_graph(path: Path) -> None:
    assert _literals(path.read_text()) == []


@pytest.mark.parametrize(
    "source",
    ['x = "/cliport/points"', 'x = f"/cliport/affordance/{kind}"', 'x = "call /cliport/resume first"', 'x = "/tf"'],
)
def test_a_literal_is_found(source: str) -> None:
    assert _literals(source) != []


def test_docstrings_may_name_topics() -> None:
    assert _literals('"""Publishes /cliport/points."""') == []


def test_actions_of_controllers() -> None:
    assert topics.trajectory_action("fr3_arm_controller") == "/fr3_arm_controller/follow_joint_trajectory"
    assert topics.gripper_action("franka_gripper") == "/franka_gripper/gripper_action"
