"""The thing at a place, as a person looking from above would say."""

from __future__ import annotations

import cv2
import numpy as np

from sim_bridge.objects import SceneObject
from sim_bridge.task_mechanics.placing import outline
from sim_bridge.world import SimWorld

_NEAR_DISTANCE = 0.01  # a place this near to a thing still means it [m]


def object_at(world: SimWorld, x: float, y: float, movable: bool) -> SceneObject | None:
    """Return the topmost thing at x, y [m], else the nearest beside it; None where there is neither.

    movable: only what is not fixed.
    """
    found: list[tuple[bool, float, SceneObject]] = []
    for thing in world.objects:
        if movable and thing.fixed:
            continue
        corners = outline(world, thing).astype(np.float32)
        depth = cv2.pointPolygonTest(corners, (x, y), True)
        if depth >= 0.0:
            found.append((True, float(world.object_pose(thing).translation[2]), thing))
        elif depth > -_NEAR_DISTANCE:
            found.append((False, depth, thing))
    return max(found, key=lambda entry: entry[:2])[2] if found else None
