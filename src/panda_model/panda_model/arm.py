"""One arm with its hand: everything that differs between two arms that this project can drive."""

from __future__ import annotations

from dataclasses import dataclass

from panda_model.hand import HandModel
from panda_model.limits import FloatArray, JointLimits


@dataclass(frozen=True)
class Description:
    """Paths of the URDF and the SRDF within a package; `prefix` begins the names in them.

    notice: what a user should know who has this description loaded, as the end of a sentence; empty for nothing.
    """

    package: str
    urdf: str
    srdf: str
    prefix: str
    notice: str = ""


@dataclass(frozen=True, eq=False)
class ArmModel:
    """An arm of seven joints and its hand, as its driver names and bounds them.

    prefix: with which the names of its links, frames and joints begin in its preset, whatever the driver calls some.
    torque: of each joint at most (7,) [N m]; ready: (7,) [rad], out of the camera's view, the hand pointing down.
    gripper_reports_full_width: True if the gripper's action, which takes half of the width, reports all of it.
    gripper_reports_stalled: False if its result never says `stalled`, so that an aborted closing may be a grasp.
    """

    name: str
    prefix: str
    arm_joints: tuple[str, ...]
    finger_joints: tuple[str, ...]
    limits: JointLimits
    torque: FloatArray
    ready: FloatArray
    base_frame: str
    flange_frame: str
    hand_frame: str
    tcp_frame: str
    arm_action: str
    gripper_action: str
    gripper_reports_full_width: bool
    gripper_reports_stalled: bool
    description: Description
    hand: HandModel

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the arm's joints, then of the fingers'."""
        return (*self.arm_joints, *self.finger_joints)
