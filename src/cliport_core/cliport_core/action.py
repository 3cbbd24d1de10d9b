"""The one action, from network to executor to bag: two poses and what the hand does with them; and goals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from cliport_core.pose import PlanarPose, Pose


class Primitive(IntEnum):
    """A way of moving between two poses; values as in the PickPlace action."""

    PICK_PLACE = 0
    SWEEP = 1
    FOLD = 2

    @property
    def label(self) -> str:
        """The name in files and on screens: pick_place, sweep or fold."""
        return self.name.lower()

    @classmethod
    def from_label(cls, label: str) -> Primitive:
        """Return the primitive of a name in a file. Raises ValueError, naming the known ones."""
        for primitive in cls:
            if primitive.label == label:
                return primitive
        raise ValueError(f"unknown primitive '{label}': known are {', '.join(p.label for p in cls)}")


@dataclass(frozen=True)
class PickPlaceAction:
    """Two poses on the table in the base frame and what the hand does with them.

    The yaw is the direction in which the jaws close; turned by half a turn it is the same grasp.
    pick: the gripper at the pick (a sweep: where the tool is set down).
    place: the gripper at the place; place.yaw - pick.yaw turns the object.
    confidence: how sure the one who chose it is, 0..1; None where that is not known.
    pick_yaw_period: turning the gripper by this at the pick is an equally good grasp [rad].
    """

    pick: PlanarPose
    place: PlanarPose
    primitive: Primitive = Primitive.PICK_PLACE
    confidence: float | None = None
    pick_yaw_period: float = math.pi


@dataclass(frozen=True)
class ActionGoal:
    """An action asked for: by the policy server or the page, of the executor.

    instruction: the goal in words, for logs and viewers.
    stamp_ns: when the images were taken that the action was chosen on [ns, ROS time]; 0 where that is not known.
    plan_only: plan and check, but do not move.
    owner: whose signs of life the motion needs; empty: nobody's, with which only plans are taken.
    """

    action: PickPlaceAction
    instruction: str = ""
    stamp_ns: int = 0
    plan_only: bool = False
    owner: str = ""


@dataclass(frozen=True)
class HandGoal:
    """A pose in space asked for: by the calibration, of the executor.

    target: of the tcp in the base frame.
    carried: how far what the hand carries reaches from the tcp [m]; 0 where it carries nothing.
    blind: move without a cloud; the arm itself, the table and a camera whose place is known are avoided.
    plan_only, owner: as an ActionGoal's.
    """

    target: Pose
    carried: float = 0.0
    blind: bool = False
    plan_only: bool = False
    owner: str = ""
