"""Whether the hand's palm has room above what stands around a thing that it takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from cliport_perception import PlanarPose
from sim_bridge.objects import SceneObject

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

_HALF_LENGTH = 0.108  # of the palm along the closing direction, with a margin [m]
_HALF_WIDTH = 0.037  # across it [m]
_ABOVE_TOP = 0.018  # the palm's underside above the top of what is held: 37.5 mm above the tcp, with a margin [m]
_LOWEST = 0.047  # the same above the table, for what is flat [m]


def palm_is_free(world: SimWorld, thing: SceneObject, gripper: PlanarPose) -> bool:
    """Whether nothing but the thing itself reaches into the palm when the gripper is down beside the thing."""
    top = float(world.object_pose(thing).apply(thing.mesh.vertices)[:, 2].max())
    level = max(top + _ABOVE_TOP, _LOWEST)
    c, s = np.cos(gripper.yaw), np.sin(gripper.yaw)
    ends = [(a * _HALF_LENGTH, b * _HALF_WIDTH) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    palm = np.array([(gripper.x + c * x - s * y, gripper.y + s * x + c * y) for x, y in ends], dtype=np.float32)
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
