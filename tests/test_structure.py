"""House rules that a reader relies on: which package may know which, who may know ROS and PyBullet, no circles."""

import ast
from functools import cache
from pathlib import Path

import pytest
from house import circles, imports, modules

SOURCE = Path(__file__).resolve().parents[1] / "src"
LIBRARIES = {"torch", "pybullet", "ompl", "pinocchio"}  # heavy ones, each known to whom it serves
# What each package may import of these libraries and of the other packages; the messages' package comes with ROS.
ALLOWED: dict[str, set[str]] = {
    "cliport_core": set(),
    "panda_model": {"cliport_core"},
    "cliport_perception": {"cliport_core", "panda_model"},
    "cliport_episodes": {"cliport_core", "cliport_perception"},
    "demo_tool": {"cliport_core", "panda_model", "cliport_perception", "cliport_episodes"},
    "cliport_policy": {"cliport_core", "panda_model", "cliport_episodes", "torch"},
    "panda_executor": {"cliport_core", "panda_model", "cliport_perception", "ompl", "pinocchio"},
    "sim_bridge": {"cliport_core", "panda_model", "cliport_perception", "pybullet"},
    "panda_driver": {"cliport_core", "panda_model", "sim_bridge"},  # of the latter what moves no world, see below
    "cliport_benchmark": {
        *("cliport_core", "panda_model", "cliport_perception", "cliport_episodes"),
        *("cliport_policy", "panda_executor", "sim_bridge", *LIBRARIES),
    },
}
# The packages within the simulator: what each may know of the others.
INNER = {
    "geometry": set(),
    "control": set(),
    "objects": {"geometry"},
    "everyday": {"geometry", "objects"},
    "rendering": {"geometry", "objects"},
    "task_mechanics": {"geometry", "objects", "everyday"},
    "tasks": {"geometry", "objects", "everyday", "task_mechanics"},
}
ROS = {"rclpy", "sensor_msgs", "std_msgs", "geometry_msgs", "cliport_interfaces", "control_msgs", "franka_msgs"}
# Files that may know ROS, by how their names begin; every other module of these packages is core.
ROS_FILES = (
    *("node", "conversions", "action_", "ros_", "main", "goal_session", "views", "executor_link"),
    *("adaptive_subscription", "messages"),
)


def _modules() -> list[Path]:
    return sorted(p for package in ALLOWED for p in (SOURCE / package / package).rglob("*.py"))


@cache
def _imports(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("path", _modules(), ids=lambda p: str(p.relative_to(SOURCE)))
def test_dependencies_point_one_way(path: Path) -> None:
    package = path.relative_to(SOURCE).parts[0]
    imported = _imports(path)
    tops = {name.split(".")[0] for name in imported}
    unknown = tops & (set(ALLOWED) | LIBRARIES) - ALLOWED[package] - {package}
    assert not unknown
    assert not [name for name in imported if _is_node(name) and not name.startswith(f"{package}.")]
    if package != "cliport_benchmark" and not path.name.startswith(ROS_FILES):  # that one drives the graph
        assert not tops & ROS, "core modules know no ROS"


def _is_node(name: str) -> bool:
    parts = name.split(".")
    return parts[0] in ALLOWED and len(parts) > 1 and (parts[1] == "node" or parts[1].startswith("node_"))


def test_every_package_is_held_to_the_rules() -> None:
    packages = {path.name for path in SOURCE.iterdir() if (path / path.name / "__init__.py").is_file()}
    assert packages == set(ALLOWED)


@pytest.mark.parametrize("inner", INNER)
def test_packages_of_the_simulator_build_on_each_other(inner: str) -> None:
    allowed = INNER[inner] | {inner}
    for path in (SOURCE / "sim_bridge/sim_bridge" / inner).glob("*.py"):
        known = {name.split(".")[1] for name in _imports(path) if name.startswith("sim_bridge.")}
        assert known & set(INNER) <= allowed, path


def test_the_driver_shares_the_rules_of_controllers_and_no_simulator() -> None:
    for path in (SOURCE / "panda_driver/panda_driver").rglob("*.py"):
        parts = [name.split(".") for name in _imports(path)]
        known = {inner for top, *rest in parts if top == "sim_bridge" for inner in rest[:1]}
        assert known <= {"control", "conversions"}, path


def test_franky_is_known_to_one_file() -> None:
    knowing = [path.name for path in _modules() if "franky" in {name.split(".")[0] for name in _imports(path)}]
    assert knowing == ["franky_ports.py"]


def test_encoders_know_no_network() -> None:
    files = sorted((SOURCE / "cliport_policy/cliport_policy/encoders").glob("*.py"))
    assert files
    for path in files:
        assert not any(name.startswith("cliport_policy.networks") for name in _imports(path)), path


def test_the_simulator_is_layered() -> None:
    """The world knows no task; only what sets scenes up, and what is above that, knows both."""
    for path in (SOURCE / "sim_bridge/sim_bridge").rglob("*.py"):
        known = {name.removeprefix("sim_bridge.").split(".")[0] for name in _imports(path)}
        if path.name in ("world.py", "world_snapshot.py", "sleeping.py"):
            assert not known & {"tasks", "task_mechanics", "scene"}, path
        if path.parent.name in ("tasks", "task_mechanics"):
            assert "scene" not in known, path


def test_no_module_imports_itself_over_others() -> None:
    known = modules(SOURCE.parent)
    assert {"cliport_core.pose", "ros2cli_small.main", "sim_bridge.tasks.registry"} <= set(known)
    graph = {name: imports(module, known) for name, module in known.items()}
    assert graph["sim_bridge.scene"] >= {"sim_bridge.world", "sim_bridge.tasks.registry"}
    assert circles(graph) == []


def test_circles_are_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}, "e": {"a"}}
    assert circles(graph) == [["b", "c"]]


def test_the_core_stands_on_no_other_package() -> None:
    ours = {path.name for path in SOURCE.iterdir() if path.is_dir()} - {"cliport_core", "cliport_interfaces"}
    assert len(ours) > 6
    for path in (SOURCE / "cliport_core/cliport_core").rglob("*.py"):
        assert not {name.split(".")[0] for name in _imports(path)} & ours, path


def test_node_files_stay_thin() -> None:
    for path in SOURCE.glob("*/*/node.py"):
        assert len(path.read_text().splitlines()) <= 170, path
