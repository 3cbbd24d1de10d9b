"""Clearance of the hand: of the opened fingers beside a thing, where it lies
and where it goes, and of the palm above it."""

from __future__ import annotations

import cv2
import numpy as np

from cliport_core import PlanarPose, WorkspaceSpec
from sim_bridge.objects import SceneObject
from sim_bridge.robot import BESIDE, HAND
from sim_bridge.world import SimWorld

# Of a finger, with a margin: the executor sees neighbours through noise and keeps its distance [m].
_HALF_WIDTH = HAND.finger_half_width + 0.0015
_MARGIN = 0.06  # of the map around the workspace [m]

_PALM_MARGIN = 0.005  # around the palm [m]
_PALM_HALF_LENGTH = HAND.palm_half_length + _PALM_MARGIN
_PALM_HALF_WIDTH = HAND.palm_half_width + _PALM_MARGIN
# The palm's underside above the top of what is held: the tcp is at most a pad's length below that; with a margin [m].
_PALM_ABOVE_TOP = HAND.palm_above_tcp - HAND.pad_length - 0.001
_LOWEST_PALM = HAND.finger_length  # of the palm above the table, for flat things [m]


class FingerClearance:
    """Map, seen from above, of the things in a world that stand higher than `level` [m], except for one."""

    def __init__(self, world: SimWorld, left_out: SceneObject, level: float) -> None:
        self._workspace: WorkspaceSpec = world.config.workspace
        rows, cols = self._workspace.shape
        pad = round(_MARGIN / self._workspace.pixel_size)
        self._taken = np.zeros((rows + 2 * pad, cols + 2 * pad), dtype=np.uint8)
        for thing in world.objects:
            if thing is left_out or thing.shape.collision is None:
                continue
            pose = world.object_pose(thing)
            for part in thing.shape.collision.parts:
                corners = pose.apply(part.corners)
                if corners[:, 2].max() > level:
                    hull = cv2.convexHull(corners[:, :2].astype(np.float32)).reshape(-1, 2)
                    cv2.fillConvexPoly(self._taken, self._pixels(hull), 1, shift=4)

    def blocked(self, gripper: PlanarPose, width: float) -> float:
        """Return the share of the fingers' ground that is taken when they open beside a thing `width` [m] wide."""
        inner, outer, across = width / 2, width / 2 + BESIDE, _HALF_WIDTH
        taken, size = 0, 0
        for side in (-1.0, 1.0):
            ground = np.zeros_like(self._taken)
            corners = [(inner, -across), (inner, across), (outer, across), (outer, -across)]
            finger = gripper.apply([(side * along, beside) for along, beside in corners])
            cv2.fillConvexPoly(ground, self._pixels(finger), 1, shift=4)
            taken += int(np.count_nonzero(ground & self._taken))
            size += int(np.count_nonzero(ground))
        return taken / max(size, 1)

    def _pixels(self, corners: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        spec = self._workspace
        low = (spec.x_min - _MARGIN, spec.y_min - _MARGIN)
        return np.asarray(np.rint(((corners - low) / spec.pixel_size - 0.5) * 16), dtype=np.int32)


def palm_is_free(world: SimWorld, thing: SceneObject, gripper: PlanarPose) -> bool:
    """Return True if nothing but the thing itself reaches into the palm when the gripper is down beside the thing."""
    top = float(world.object_pose(thing).apply(thing.mesh.vertices)[:, 2].max())
    level = max(top + _PALM_ABOVE_TOP, _LOWEST_PALM)
    ends = [(a * _PALM_HALF_LENGTH, b * _PALM_HALF_WIDTH) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    palm = gripper.apply(ends).astype(np.float32)
    for other in world.objects:
        if other is thing or other.shape.collision is None:
            continue
        pose = world.object_pose(other)
        for part in other.shape.collision.parts:
            corners = pose.apply(part.corners)
            if corners[:, 2].max() > level:
                hull = cv2.convexHull(corners[:, :2].astype(np.float32))
                if cv2.intersectConvexConvex(palm, hull)[0] > 0.0:
                    return False
    return True
