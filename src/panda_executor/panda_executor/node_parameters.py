"""The executor node's ROS parameters, read once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from cliport_perception.workspace import WorkspaceSpec
from panda_executor.config import ExecutorConfig
from panda_executor.errors import ExecutorError
from panda_executor.presets import RobotPreset, find_preset

if TYPE_CHECKING:
    from rclpy.node import Node


@dataclass(frozen=True)
class NodeParameters:
    """What the node is told from outside; ages and waits in s."""

    robot: RobotPreset
    config: ExecutorConfig
    workspace: WorkspaceSpec
    max_cloud_age: float
    max_joint_age: float
    cloud_behind: float
    cloud_wait: float


def read_parameters(node: Node) -> NodeParameters:
    """Declare and read every parameter. An empty name takes the robot preset's.

    Raises:
        ExecutorError: on an unknown robot or a value out of range.
        PerceptionError: when the workspace file cannot be used.
    """

    def get(name: str, default: Any) -> Any:
        return node.declare_parameter(name, default).value

    preset = find_preset(str(get("robot", "panda")))
    names: dict[str, Any] = {}
    for name in ("base_frame", "arm_action", "gripper_action"):
        names[name] = str(get(name, "")) or getattr(preset, name)
    for name in ("arm_joints", "finger_joints"):
        names[name] = tuple(str(v) for v in get(name, list(getattr(preset, name))))
    full = bool(get("gripper_reports_full_width", preset.gripper_reports_full_width))
    robot = replace(preset, gripper_reports_full_width=full, **names)
    if len(robot.arm_joints) != 7 or not robot.finger_joints:
        raise ExecutorError("arm_joints must name seven joints and finger_joints at least one")
    path = str(get("workspace", ""))
    return NodeParameters(
        robot,
        _read_config(get),
        WorkspaceSpec.load(path) if path else WorkspaceSpec(),
        max_cloud_age=float(get("max_cloud_age", 2.0)),
        max_joint_age=float(get("max_joint_age", 0.5)),
        cloud_behind=float(get("cloud_behind", 0.0)),
        cloud_wait=float(get("cloud_wait", 3.0)),
    )


def _read_config(get: Any) -> ExecutorConfig:
    config = ExecutorConfig()
    timing = {}
    for name in ("velocity_scaling", "acceleration_scaling", "jerk_scaling"):
        value = float(get(name, getattr(config.timing, name)))
        if not 0.0 < value <= 1.0:
            raise ExecutorError(f"{name} must be in (0, 1], got {value:g}")
        timing[name] = value
    force = float(get("grip_force", config.grip_force))
    if not 0.0 < force <= 60.0:
        raise ExecutorError(f"grip_force must be in (0, 60] N, got {force:g}")
    camera = [float(v) for v in get("camera_position", list(config.scene.camera_position))]
    if len(camera) != 3:
        raise ExecutorError(f"camera_position must be x, y, z [m], got {camera}")
    table_z = float(get("table_z", config.scene.table_z))
    scene = replace(config.scene, camera_position=(camera[0], camera[1], camera[2]), table_z=table_z)
    return replace(
        config,
        timing=replace(config.timing, **timing),
        scene=scene,
        grip_force=force,
        search=replace(config.search, seed=int(get("seed", config.search.seed))),
    )
