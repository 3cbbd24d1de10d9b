"""The room that the arm itself needs to grasp at one place and to let go at another, by the simulator's own bodies."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pybullet

from cliport_core import PlanarPose
from cliport_core.action import PickPlaceAction
from panda_executor.errors import InverseKinematicsError
from panda_executor.ik import HandDownIk, hand_down_pose
from sim_bridge.objects.block import BLOCK_SIZE
from sim_bridge.robot import HAND, ROBOT
from sim_bridge.world import SimWorld

FloatArray = npt.NDArray[np.float64]
Ends = list[FloatArray]  # for each configuration on a block the one above it too: (2, 7) [rad]

RISE = 0.12  # from the grasp to where the arm comes from [m]
_BRANCH = 1.0  # a joint that turns more on that way has left its branch [rad]


def set_arm(world: SimWorld, positions: FloatArray, width: float) -> None:
    """Put the world's arm at positions (7,) [rad], its fingers `width` [m] apart."""
    arm = world.panda
    values = dict(zip(ROBOT.arm_joints, positions.tolist(), strict=True))
    values |= dict.fromkeys(ROBOT.finger_joints, width / 2.0)
    for name, value in values.items():
        link = name.replace("finger_joint1", "leftfinger").replace("finger_joint2", "rightfinger")
        index = arm.link_indices[link.replace("joint", "link")]
        pybullet.resetJointState(arm.body, index, value, physicsClientId=world.client)


class ArmRoom:
    """Every way to hold a block, a quarter turn apart, in which the arm still reaches pick and place.

    room: from the arm to all things, on the block and above it [m].
    """

    def __init__(self, world: SimWorld, ik: HandDownIk, action: PickPlaceAction, room: float) -> None:
        self._world, self._room = world, room
        turns = [quarter * math.pi / 2.0 for quarter in range(4)]
        ways = [(_ends(ik, action.pick, turn), _ends(ik, action.place, turn)) for turn in turns]
        self._ways = [way for way in ways if all(way)]

    def is_reached(self) -> bool:
        """Return True if there is a way."""
        return bool(self._ways)

    def allow(self, body: int) -> bool:
        """Return whether a way is left beside a new body; then those that are not are forgotten."""
        left = [tuple([ends for ends in side if self._is_clear(ends, body)] for side in way) for way in self._ways]
        self._world.panda.reset_home()
        ways = [(pick, place) for pick, place in left if pick and place]
        if ways:
            self._ways = ways
        return bool(ways)

    def _is_clear(self, ends: FloatArray, body: int) -> bool:
        for positions in ends:
            set_arm(self._world, positions, HAND.opening)
            arm = self._world.panda.body
            if pybullet.getClosestPoints(arm, body, self._room, physicsClientId=self._world.client):
                return False
        return True


def _ends(ik: HandDownIk, at: PlanarPose, turn: float) -> Ends:
    grasp, above = (hand_down_pose(at.x, at.y, z, at.yaw + turn) for z in (BLOCK_SIZE / 2, BLOCK_SIZE / 2 + RISE))
    try:
        solutions = ik.solve_all(above, ROBOT.ready)
    except InverseKinematicsError:
        return []
    pairs = [(ik.solve_near(grasp, solution.positions, _BRANCH), solution.positions) for solution in solutions]
    return [np.stack([low, high]) for low, high in pairs if low is not None]
