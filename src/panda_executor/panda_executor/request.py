"""What is asked of the executor, the phases it goes through, and how it ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from cliport_perception.pose import PlanarPose
from cliport_perception.primitive import Outcome, Primitive
from panda_executor.limits import FloatArray


class Phase(IntEnum):
    """Where a request stands; values as in the PickPlace action."""

    VALIDATING = 0
    GRASP_PLANNING = 1
    GO_ABOVE_PICK = 2
    DESCEND = 3
    CLOSE = 4
    RAISE = 5
    CARRY = 6
    LOWER = 7
    OPEN = 8
    RETREAT = 9
    DONE = 10


@dataclass(frozen=True)
class PickPlaceRequest:
    """Poses on the table [m, rad; base frame]. The yaw is the direction in which the jaws close (see ik.py).

    pick.yaw is the gripper's at the pick, place.yaw the gripper's at the place: their difference turns the
    object. With plan_only nothing moves.
    """

    pick: PlanarPose
    place: PlanarPose
    primitive: Primitive = Primitive.PICK_PLACE
    plan_only: bool = False


@dataclass(frozen=True, eq=False)
class PickPlaceResult:
    """The end of a request: one line of message; what is known of the grasp: centroid (3,) [m], width [m]."""

    outcome: Outcome
    message: str
    grasp_centroid: FloatArray | None
    gripper_width: float
