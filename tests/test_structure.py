"""The house rules that a reader relies on: which room may know which, and who may know ROS and PyBullet."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src"
_ROOMS_ABOVE = {"cliport_policy", "panda_executor", "sim_bridge", "cliport_benchmark", "demo_tool"}
FORBIDDEN = {
    "cliport_episodes": {"torch", "pybullet", "ompl", "pinocchio"} | _ROOMS_ABOVE,
    "demo_tool": {"torch", "pybullet", "ompl", "pinocchio"} | _ROOMS_ABOVE - {"demo_tool"},
    "cliport_perception": {
        "torch",
        "pybullet",
        "ompl",
        "pinocchio",
        "cliport_policy",
        "panda_executor",
        "sim_bridge",
    },
    "cliport_policy": {"pybullet", "ompl", "pinocchio", "panda_executor", "sim_bridge", "cliport_benchmark"},
    "panda_executor": {"pybullet", "torch", "cliport_policy", "sim_bridge", "cliport_benchmark"},
    "sim_bridge": {"torch", "ompl", "pinocchio", "cliport_policy", "panda_executor", "cliport_benchmark"},
}
# The rooms within the simulator: what each may know of the others.
INNER = {
    "geometry": set(),
    "control": set(),
    "objects": {"geometry"},
    "everyday": {"geometry", "objects"},
    "rendering": {"geometry", "objects"},
    "task_mechanics": {"geometry", "objects", "everyday"},
    "tasks": {"geometry", "objects", "everyday", "task_mechanics"},
}
ROS = {"rclpy", "sensor_msgs", "std_msgs", "geometry_msgs", "cliport_interfaces", "control_msgs"}
# Files that may know ROS, by how their names begin; every other module of these packages is core.
ROS_ROOMS = (
    *("node", "conversions", "action_", "ros_", "main", "goal_session", "views", "executor_link"),
    "adaptive_subscription",
)


def _modules() -> list[Path]:
    return sorted(p for package in FORBIDDEN for p in (SOURCE / package / package).rglob("*.py"))


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
    assert not {name.split(".")[0] for name in imported} & FORBIDDEN[package]
    other_nodes = {f"{other}.node" for other in FORBIDDEN if other != package} & imported
    assert not other_nodes
    if not path.name.startswith(ROS_ROOMS):
        assert not {name.split(".")[0] for name in imported} & ROS, "core modules know no ROS"


@pytest.mark.parametrize("room", INNER)
def test_rooms_of_the_simulator_build_on_each_other(room: str) -> None:
    allowed = INNER[room] | {room}
    for path in (SOURCE / "sim_bridge/sim_bridge" / room).glob("*.py"):
        known = {name.split(".")[1] for name in _imports(path) if name.startswith("sim_bridge.")}
        assert known & set(INNER) <= allowed, path


def test_node_files_stay_thin() -> None:
    for path in SOURCE.glob("*/*/node.py"):
        assert len(path.read_text().splitlines()) <= 170, path
