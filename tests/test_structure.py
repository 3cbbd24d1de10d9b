"""The house rules that a reader relies on: which room may know which, who may know ROS and PyBullet, and no circles."""

import ast
from pathlib import Path

import pytest
from house import circles, imports, modules

SOURCE = Path(__file__).resolve().parents[1] / "src"
_ROOMS_ABOVE = {"cliport_policy", "panda_executor", "sim_bridge", "cliport_benchmark", "demo_tool"}
FORBIDDEN = {
    "cliport_episodes": {"torch", "pybullet", "ompl", "pinocchio"} | _ROOMS_ABOVE,
    "demo_tool": {"torch", "pybullet", "ompl", "pinocchio"} | _ROOMS_ABOVE - {"demo_tool"},
    "cliport_core": {"torch", "pybullet", "ompl", "pinocchio", "cliport_perception", "cliport_episodes", "panda_model"}
    | _ROOMS_ABOVE,
    "panda_model": {"torch", "pybullet", "ompl", "pinocchio", "cliport_perception", "cliport_episodes"} | _ROOMS_ABOVE,
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
    *("adaptive_subscription", "messages"),
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
