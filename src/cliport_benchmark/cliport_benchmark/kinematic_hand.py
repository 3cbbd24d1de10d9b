"""Carries out actions without the arm, in a tenth of the time: things are set where they belong and settle."""

from __future__ import annotations

import math

import numpy as np

from cliport_benchmark.kinematic_drag import fold, sweep
from cliport_benchmark.setting_down import set_down
from cliport_core import PickPlaceAction, PlanarPose, Pose, Primitive
from cliport_core.outcome import ActionResult, Outcome
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.task_mechanics.object_at import object_at
from sim_bridge.world import SimWorld

# as the arm's own placements of blocks, boxes and kit shapes scatter in full physics
PLACE_SIGMA = 0.001  # of where a thing lands, per axis [m]
YAW_SIGMA = math.radians(0.5)


class KinematicHand:
    """A hand of no shape and no mass; rng draws its inaccuracy."""

    def __init__(self, world: SimWorld, rng: np.random.Generator) -> None:
        self._world = world
        self._rng = rng

    def new_scene(self, primitive: Primitive) -> None:
        """Take note of a new scene: there is nothing to forget."""

    def execute(self, action: PickPlaceAction, frame: RgbdFrame) -> ActionResult:
        """Move what lies at the pick as the gripper would from there to the place, and let the world settle."""
        pick, place, primitive = action.pick, action.place, action.primitive
        found = True
        if primitive is Primitive.SWEEP:
            sweep(self._world, pick, place)
        elif primitive is Primitive.FOLD:
            fold(self._world, pick, place)
        else:
            found = self._pick_and_place(pick, place)
            self._world.settle()
        return ActionResult(Outcome.SUCCEEDED if found else Outcome.GRASP_MISSED, "" if found else "nothing lies there")

    def _pick_and_place(self, pick: PlanarPose, place: PlanarPose) -> bool:
        """Return False where nothing lies at the pick."""
        shift = self._rng.normal(0.0, PLACE_SIGMA, 2)
        turn = float(self._rng.normal(0.0, YAW_SIGMA)) + place.yaw - pick.yaw
        thing = object_at(self._world, pick.x, pick.y, movable=True)
        if thing is None:
            return False
        here = self._world.object_pose(thing)
        there = Pose.from_xyz_rpy((place.x + shift[0], place.y + shift[1], 0.0), (0.0, 0.0, turn))
        set_down(self._world, thing, there @ Pose(np.eye(3), np.array([-pick.x, -pick.y, 0.0])) @ here)
        return True
