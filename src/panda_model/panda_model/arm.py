"""One arm with its hand: everything that differs between two arms that this project can drive."""

from __future__ import annotations

from dataclasses import dataclass, replace

from panda_model.hand import HandModel
from panda_model.limits import FloatArray, JointLimits


@dataclass(frozen=True)
class Description:
    """Paths of the URDF and the SRDF within a package; `prefix` begins the names in them.

    notice: what a user should know who has this description loaded, as the end of a sentence; empty for nothing.
    own: "package:path" of a URDF that is the arm's own, where this one stands in for it; empty for none.
    """

    package: str
    urdf: str
    srdf: str
    prefix: str
    notice: str = ""
    own: str = ""


@dataclass(frozen=True, eq=False)
class ArmModel:
    """An arm of seven joints and its hand, as its driver names and bounds them.

    prefix: with which the names of its links, frames and joints begin in its preset, whatever the driver calls some.
    torque: of each joint at most (7,) [N m]; ready: (7,) [rad], out of the camera's view, the hand pointing down.
    gripper_reports_full_width: True if the gripper's action, which takes half of the width, reports all of it.
    gripper_reports_stalled: False if its result never says `stalled`, so that an aborted closing may be a grasp.
    franka_gripper: under which name the gripper offers the actions of franka_msgs, grasp, move and homing, and the
        service stop; empty where it does not.
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
    franka_gripper: str = ""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the arm's joints, then of the fingers'."""
        return (*self.arm_joints, *self.finger_joints)

    @property
    def grasp_action(self) -> str:
        """Name of the gripper's action franka_msgs/Grasp."""
        return f"{self.franka_gripper}/grasp"

    @property
    def move_action(self) -> str:
        """Name of the gripper's action franka_msgs/Move."""
        return f"{self.franka_gripper}/move"

    @property
    def homing_action(self) -> str:
        """Name of the gripper's action franka_msgs/Homing."""
        return f"{self.franka_gripper}/homing"

    @property
    def gripper_stop(self) -> str:
        """Name of the service that stops the fingers."""
        return f"{self.franka_gripper}/stop"

    @property
    def motion_actions(self) -> tuple[str, ...]:
        """Names of all actions whose goals move the arm or the fingers."""
        fingers = (self.grasp_action, self.move_action, self.homing_action) if self.franka_gripper else ()
        return (self.arm_action, self.gripper_action, *fingers)

    def with_gripper(self, action: str) -> ArmModel:
        """Return this arm with another gripper, behind that GripperCommand action alone; empty: its own."""
        return self if action in ("", self.gripper_action) else replace(self, gripper_action=action, franka_gripper="")
