"""The arm and the hand are stated once, in panda_model: their dimensions, limits and names; topics in cliport_core."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import pytest
import yaml
from house import is_hand, modules, topic_literals

SOURCE = Path(__file__).resolve().parents[1] / "src"
PRESETS = SOURCE / "panda_model/panda_model/presets"
PACKAGES = sorted(
    p.name for p in SOURCE.iterdir() if (p / p.name / "__init__.py").is_file() and p.name != "panda_model"
)
NAME = re.compile(
    r"^/?(panda|fr3)_(joint|link|hand|finger|leftfinger|rightfinger|arm_controller|gripper)|^/?franka_gripper"
)
# What shares a number with the arm or the hand by chance.
CHANCE = {
    ("sim_bridge/objects/pallet.py", 0.0375),  # the paper's pallet is 37.5 mm high
    ("sim_bridge/everyday/tools.py", 12.5),  # mm of a tool
}


def numbers_in(value: object) -> Iterator[float]:
    """Every number of a YAML value."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        for part in value:
            yield from numbers_in(part)
    elif isinstance(value, float):
        yield value


@lru_cache
def telling_numbers() -> frozenset[float]:
    """Numbers of the presets that nobody writes down by chance: three digits or more that count."""
    found = {abs(n) for path in PRESETS.rglob("*.yaml") for n in numbers_in(yaml.safe_load(path.read_text()))}
    return frozenset(n for n in found if len(f"{n:.10g}".replace(".", "").strip("0")) >= 3)


def is_number(node: ast.expr | None) -> bool:
    """Return True if an expression is made of numbers alone, at least one of them not zero."""
    if isinstance(node, (ast.Tuple, ast.List)):
        return bool(node.elts) and all(is_number(part) for part in node.elts)
    if isinstance(node, ast.Dict):
        return any(is_number(part) for part in node.values)
    if isinstance(node, ast.BinOp):
        sides = (node.left, node.right)
        whole = [isinstance(side, ast.Constant) and isinstance(side.value, int) for side in sides]
        return not all(whole) and all(is_number(side) or known for side, known in zip(sides, whole))
    if isinstance(node, ast.UnaryOp):
        return is_number(node.operand)
    return isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value != 0.0


def stated(tree: ast.Module) -> Iterator[tuple[str, ast.expr, int]]:
    """(name, value, line) of each constant, field and default of an argument."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                yield ast.unparse(target).rpartition(".")[2], node.value, node.lineno
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            yield ast.unparse(node.target).rpartition(".")[2], node.value, node.lineno
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            arguments = [*node.args.posonlyargs, *node.args.args]
            for argument, default in zip(reversed(arguments), reversed(node.args.defaults)):
                yield argument.arg, default, default.lineno
            for argument, keyword in zip(node.args.kwonlyargs, node.args.kw_defaults):
                if keyword is not None:
                    yield argument.arg, keyword, keyword.lineno


def docstrings(tree: ast.Module) -> set[int]:
    """Identities of the constants that are docstrings."""
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, owners) and node.body]
    return {id(body[0].value) for body in bodies if isinstance(body[0], ast.Expr)}


def faults_in(text: str, where: str) -> list[str]:
    """Return the statements of a module that panda_model makes already, in words."""
    tree = ast.parse(text)
    faults = [
        f"{where}:{line}: {name} is a dimension of the hand: take it from panda_model's HandModel"
        for name, value, line in stated(tree)
        if is_hand(name) and is_number(value)
    ]
    telling, spoken = telling_numbers(), docstrings(tree)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or id(node) in spoken:
            continue
        if isinstance(node.value, float) and node.value in telling and (where, node.value) not in CHANCE:
            faults.append(f"{where}:{node.lineno}: {node.value} stands in a preset of panda_model: take it from there")
        if isinstance(node.value, str) and NAME.match(node.value):
            faults.append(f"{where}:{node.lineno}: '{node.value}' is a preset's name: take it from panda_model")
    return faults


@pytest.mark.parametrize("package", PACKAGES)
def test_no_package_states_the_arm_or_the_hand_again(package: str) -> None:
    faults: list[str] = []
    for path in sorted((SOURCE / package / package).rglob("*.py")):
        faults += faults_in(path.read_text(), str(path.relative_to(SOURCE / package)))
    assert not faults, "\n".join(faults)


def test_no_module_states_a_topic_again() -> None:
    known = modules(SOURCE.parent)
    assert "cliport_core.topics" in known
    assert not [found for module in known.values() for found in topic_literals(module)]


@pytest.mark.parametrize(
    "line",
    [
        "_FINGER_HALF_WIDTH = 0.012",
        "JAW_WIDTH = 2 * 0.01",
        "MAX_OPENING: float = 0.08",
        "_OPENINGS = {PICK: 0.08, SWEEP: 0.0}",
        "def reach(finger_width: float = 0.02): ...",
        "class Config:\n    palm_half_length: float = 0.103",
        "LONG = 0.0152 + margin",
        "LOWER = (-2.8973, 1.0)",
        "JOINTS = [f'panda_joint{i}' for i in range(7)]",
        "BASE = 'fr3_link0'",
        "ACTION = '/panda_gripper/gripper_action'",
    ],
)
def test_the_check_finds_what_it_looks_for(line: str) -> None:
    assert faults_in(line, "module.py")


@pytest.mark.parametrize(
    "line",
    [
        "_FINGER_FRICTION = 1.5",
        "_HALF_WIDTH = HAND.finger_half_width + 0.0015",
        "OPENING = hand.opening",
        "opening = 0.0",
        '"""panda_link0 is the base."""',
        "SIZE = 0.08",
    ],
)
def test_the_check_lets_other_things_be(line: str) -> None:
    assert not faults_in(line, "module.py")


def test_the_camera_stands_where_one_file_says() -> None:
    mounting = yaml.safe_load((SOURCE / "sim_bridge/sim_bridge/rendering/mounting.yaml").read_text())["camera"]
    x, _, z = mounting["position"]
    for path in sorted(SOURCE.glob("*/*/**/*.py")):
        if "test" in path.relative_to(SOURCE).parts:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Tuple):
                values = [part.value for part in node.elts if isinstance(part, ast.Constant)]
                assert not (len(values) == 3 and values[0] == x and values[2] == z), f"{path}:{node.lineno}"
