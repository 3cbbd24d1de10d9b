"""What differs between the arms that the executor can drive: names, limits, the gripper's habits."""

from __future__ import annotations

from dataclasses import dataclass

from panda_executor.errors import ExecutorError
from panda_executor.limits import FR3_LIMITS, PANDA_LIMITS, JointLimits


@dataclass(frozen=True)
class RobotPreset:
    """Names of joints, frame and actions. The gripper's joints each move half of the width."""

    arm_joints: tuple[str, ...]
    finger_joints: tuple[str, ...]
    base_frame: str
    arm_action: str
    gripper_action: str
    limits: JointLimits
    gripper_reports_full_width: bool = True


def _franka(prefix: str, arm_controller: str, gripper: str, limits: JointLimits) -> RobotPreset:
    return RobotPreset(
        arm_joints=tuple(f"{prefix}_joint{i}" for i in range(1, 8)),
        finger_joints=tuple(f"{prefix}_finger_joint{i}" for i in (1, 2)),
        base_frame=f"{prefix}_link0",
        arm_action=f"/{arm_controller}/follow_joint_trajectory",
        gripper_action=f"/{gripper}/gripper_action",
        limits=limits,
    )


PRESETS = {
    "panda": _franka("panda", "panda_arm_controller", "panda_gripper", PANDA_LIMITS),
    "fr3": _franka("fr3", "fr3_arm_controller", "franka_gripper", FR3_LIMITS),
}


def find_preset(name: str) -> RobotPreset:
    """The preset of that name.

    Raises:
        ExecutorError: on an unknown name; lists the known ones.
    """
    try:
        return PRESETS[name]
    except KeyError:
        raise ExecutorError(f"unknown robot '{name}'; known are {', '.join(sorted(PRESETS))}") from None
