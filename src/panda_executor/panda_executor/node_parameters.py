"""The executor node's ROS parameters, read once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cliport_core import topics
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.calibration.calibration_file import load_calibration
from panda_executor.arm_watch import ArmWatch
from panda_executor.config import ExecutorConfig, SearchConfig
from panda_executor.errors import ExecutorError
from panda_executor.parameter_checks import Get, finite, not_negative, positive, whole
from panda_executor.scene import SceneConfig
from panda_model import DEFAULT_PRESET, ArmModel, load_preset

if TYPE_CHECKING:
    from rclpy.node import Node

Choice = TypeVar("Choice", bound=Enum)
_SAME_HEIGHT = 1e-4  # [m]


@dataclass(frozen=True)
class NodeParameters:
    """Values of the node's parameters; ages and waits in s.

    auto_approve: False has each plan wait for its approval, for at most approval_time; self_clearance: between links of
    the arm [m]; owner_silence: of a motion's owner, until the motion is stopped; work_silence: between two looks at
    a motion, until the heartbeat ends; cameras: how many perception joins.

    require_owner: whether a goal that moves must name who asks for it. guard_silence: of a guard that lives [s]; 0 asks
    for none.

    robot_description: the user's own URDF, as a path or as XML; empty: the preset's.
    """

    robot: ArmModel
    robot_description: str
    config: ExecutorConfig
    workspace: WorkspaceSpec
    max_cloud_age: float
    max_joint_age: float
    cloud_behind: float
    cloud_wait: float
    max_ahead: float
    auto_approve: bool
    approval_time: float
    require_owner: bool
    guard_silence: float
    self_clearance: float
    watch: ArmWatch
    owner_silence: float
    work_silence: float
    cameras: int


def read_parameters(node: Node) -> NodeParameters:
    """Declare and read every parameter. An empty name takes the robot preset's.

    Raises:
        ExecutorError: on a value out of range.
        CoreError: on an unknown robot; when the preset's or the workspace's file cannot be used.
    """

    def get(name: str, default: Any) -> Any:
        return node.declare_parameter(name, default).value

    preset = load_preset(str(get("robot", DEFAULT_PRESET)))
    names: dict[str, Any] = {}
    for name in ("base_frame", "arm_action"):
        names[name] = str(get(name, "")) or getattr(preset, name)
    for name in ("arm_joints", "finger_joints"):
        names[name] = tuple(str(v) for v in get(name, list(getattr(preset, name))))
    for name in ("gripper_reports_full_width", "gripper_reports_stalled"):
        names[name] = bool(get(name, getattr(preset, name)))
    robot = replace(preset, **names).with_gripper(str(get("gripper_action", "")))
    if len(robot.arm_joints) != 7 or not robot.finger_joints:
        raise ExecutorError("arm_joints must name seven joints and finger_joints at least one")
    path = str(get("workspace", ""))
    return NodeParameters(
        robot,
        str(get("robot_description", "")),
        _read_config(get, robot),
        WorkspaceSpec.load(path) if path else WorkspaceSpec(),
        max_cloud_age=positive(get, "max_cloud_age", 2.0),
        max_joint_age=positive(get, "max_joint_age", 0.5),
        cloud_behind=not_negative(get, "cloud_behind", 0.0),
        cloud_wait=not_negative(get, "cloud_wait", 3.0),
        auto_approve=bool(get("auto_approve", False)),
        approval_time=positive(get, "approval_time", 30.0),
        require_owner=bool(get("require_owner", True)),
        guard_silence=not_negative(get, "guard_silence", 3.0),
        self_clearance=positive(get, "self_clearance", 0.03),
        max_ahead=not_negative(get, "max_ahead", 0.25),
        watch=_read_watch(get),
        owner_silence=positive(get, "owner_silence", 0.3),
        work_silence=positive(get, "work_silence", 0.25),
        cameras=whole(get, "cameras", 1, topics.MOST_CAMERAS),
    )


def _table_z(get: Get, default: float) -> float:
    """Return the table's height [m, base frame]: the calibration file's, else the parameter's.

    Raises:
        ExecutorError: when both say something, and not the same.
        CoreError: when the calibration's file cannot be used.
    """
    path = str(get("calibration", ""))
    known = load_calibration(Path(path)).table_z if path else None
    value = finite(get, "table_z", default if known is None else known)
    if known is not None and abs(value - known) > _SAME_HEIGHT:
        raise ExecutorError(f"table_z is {value:g}, and {path} has it at {known:g}: leave the parameter out")
    return value


def _read_watch(get: Get) -> ArmWatch:
    watch = ArmWatch()
    names = ("path_tolerance", "goal_tolerance", "goal_time")
    return replace(watch, **{name: positive(get, name, getattr(watch, name)) for name in names})


def _read_search(get: Get, default: SearchConfig) -> SearchConfig:
    return replace(
        default,
        algorithm=_member(get, "search", default.algorithm),
        seed=int(get("seed", default.seed)),
        time_limit=positive(get, "search_time", default.time_limit),
    )


def _member(get: Get, name: str, default: Choice) -> Choice:
    """Return the member of the default's enumeration that the parameter `name` names. Raises ExecutorError."""
    value = str(get(name, default.value))
    for member in type(default):
        if member.value == value:
            return member
    known = ", ".join(str(member.value) for member in type(default))
    raise ExecutorError(f"unknown {name} '{value}'; known are {known}")


def _share(get: Get, name: str, default: float) -> float:
    """Return the parameter `name`. Raises ExecutorError unless it is in (0, 1]."""
    value = float(get(name, default))
    if not 0.0 < value <= 1.0:
        raise ExecutorError(f"{name} must be in (0, 1], got {value:g}")
    return value


def _read_scene(get: Get, default: SceneConfig) -> SceneConfig:
    margins = ("arm_clearance", "load_clearance", "own_margin")
    return replace(
        default,
        table_z=_table_z(get, default.table_z),
        unseen=_member(get, "unseen", default.unseen),
        **{name: not_negative(get, name, getattr(default, name)) for name in margins},
    )


def _read_config(get: Get, robot: ArmModel) -> ExecutorConfig:
    config = ExecutorConfig.for_arm(robot)
    timing = {}
    for name in ("velocity_scaling", "acceleration_scaling", "jerk_scaling"):
        timing[name] = _share(get, name, getattr(config.timing, name))
    for name in ("tcp_speed", "tcp_speed_near"):
        timing[name] = positive(get, name, getattr(config.timing, name))
    force = float(get("grip_force", config.grip_force))
    if not 0.0 < force <= robot.hand.allowed_force:
        raise ExecutorError(f"grip_force must be in (0, {robot.hand.allowed_force:g}] N, got {force:g}")
    return replace(
        config,
        timing=replace(config.timing, **timing),
        scene=_read_scene(get, config.scene),
        clearance=not_negative(get, "clearance", config.clearance),
        straightness=positive(get, "straightness", config.straightness),
        table=replace(config.table, tolerance=positive(get, "table_tolerance", config.table.tolerance)),
        grip_force=force,
        search=_read_search(get, config.search),
        planning_time=positive(get, "planning_time", config.planning_time),
        moved_share=_share(get, "moved_share", config.moved_share),
        follow_from=positive(get, "follow_from", config.follow_from),
        after_failure=_member(get, "after_failure", config.after_failure),
    )
