"""Whether the opened fingers have room around a thing, where it lies and where it goes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from cliport_perception import PlanarPose, WorkspaceSpec
from sim_bridge.objects import SceneObject

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

_FINGER_REACH = 0.021  # what a finger takes beside the thing: its thickness and what the jaws open [m]
_FINGER_HALF_WIDTH = 0.012  # [m]
_MARGIN = 0.06  # of the picture around the workspace [m]


class FingerRoom:
    """What stands higher than `level` [m] in a world, one thing left out, as a picture from above."""

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
        """Share of the fingers' ground that is taken when they open beside a thing `width` [m] wide."""
        closing = np.array([np.cos(gripper.yaw), np.sin(gripper.yaw)])
        across = np.array([-closing[1], closing[0]]) * _FINGER_HALF_WIDTH
        taken, size = 0, 0
        for side in (-1.0, 1.0):
            inner = (gripper.x, gripper.y) + closing * (side * width / 2)
            outer = inner + closing * (side * _FINGER_REACH)
            ground = np.zeros_like(self._taken)
            corners = np.array([inner - across, inner + across, outer + across, outer - across])
            cv2.fillConvexPoly(ground, self._pixels(corners), 1, shift=4)
            taken += int(np.count_nonzero(ground & self._taken))
            size += int(np.count_nonzero(ground))
        return taken / max(size, 1)

    def _pixels(self, corners: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
        spec = self._workspace
        low = (spec.x_min - _MARGIN, spec.y_min - _MARGIN)
        return np.asarray(np.rint(((corners - low) / spec.pixel_size - 0.5) * 16), dtype=np.int32)
