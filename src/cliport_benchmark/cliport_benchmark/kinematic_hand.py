"""Carries out a pick and place without the arm, for fast data generation: the block is set into the bowl."""

from __future__ import annotations

import math

import numpy as np

from cliport_perception import PlanarPose, Pose
from sim_bridge.camera import RgbdFrame
from sim_bridge.objects import BLOCK_SIZE, BOWL_FLOOR, Kind
from sim_bridge.world import SimWorld

PLACE_SIGMA = 0.004  # spread of where a block lands, per axis [m]
YAW_SIGMA = math.radians(3.0)
_REACH = 0.03  # a pick farther from every block's centre takes nothing [m]
_DROP = 0.002  # released this high above the bowl's floor [m]


class KinematicHand:
    """A hand of no shape and no mass; rng draws its inaccuracy."""

    def __init__(self, world: SimWorld, rng: np.random.Generator) -> None:
        self._world = world
        self._rng = rng

    def pick_and_place(self, pick: PlanarPose, place: PlanarPose, frame: RgbdFrame) -> bool:
        """Move the block at `pick` to `place` and let the world settle; whether a block was there."""
        shift = self._rng.normal(0.0, PLACE_SIGMA, 2)
        turn = float(self._rng.normal(0.0, YAW_SIGMA)) + place.yaw - pick.yaw
        blocks = [o for o in self._world.objects if o.kind is Kind.BLOCK]
        if not blocks:
            return False
        at = np.array([pick.x, pick.y])
        distances = [float(np.linalg.norm(self._world.object_xy(b) - at)) for b in blocks]
        nearest = int(np.argmin(distances))
        if distances[nearest] > _REACH:
            return False
        yaw = self._world.object_yaw(blocks[nearest]) + turn
        height = BOWL_FLOOR + BLOCK_SIZE / 2 + _DROP
        pose = Pose.from_xyz_rpy((place.x + shift[0], place.y + shift[1], height), (0.0, 0.0, yaw))
        self._world.move_object(blocks[nearest], pose)
        self._world.settle()
        return True
