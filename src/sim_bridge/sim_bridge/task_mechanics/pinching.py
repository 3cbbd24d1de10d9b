"""Where parallel jaws hold a thing as it lies in the scene."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from cliport_perception import PlanarPose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.geometry.surface import surface_points
from sim_bridge.objects import Pinch, SceneObject, Shape
from sim_bridge.task_mechanics.pinch_search import FARTHEST, search_pinches

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld

_POINTS = 8000  # that stand for what is seen of a thing
_POINTS_OF_PIECE = 800  # and for a piece of what collides
OUTERMOST = 0.06  # from the centre of mass, where nothing nearer can be held [m]
_UPRIGHT = 0.98  # vertical part of the body's z axis


def pinches_of(world: SimWorld, thing: SceneObject) -> list[Pinch]:
    """The pinches of a thing relative to its planar pose (SimWorld.planar_pose), best first.

    An upright one is held as its shape says, where it does; any other where a search finds it narrow and free.
    """
    pose = world.object_pose(thing)
    if thing.shape.pinches and pose.rotation[2, 2] > _UPRIGHT:
        return list(thing.shape.pinches)
    rotation = about_z(-world.planar_pose(thing).yaw) @ pose.rotation
    return pinches_lying(thing.shape, rotation) or pinches_lying(thing.shape, rotation, farthest=OUTERMOST)


def pinches_lying(shape: Shape, rotation: npt.NDArray[np.float64], farthest: float = FARTHEST) -> list[Pinch]:
    """Pinches of a shape that lies turned by `rotation` (3, 3), best first: where it, as seen and as it collides, is
    narrow and free, nearer to its centre of mass than `farthest` [m]."""
    points = [surface_points(shape.mesh, _POINTS)]
    if shape.collision is not None:
        points += [_hull_points(part.corners) for part in shape.collision.parts]
    return search_pinches(np.concatenate(points) @ rotation.T, farthest)


def _hull_points(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    faces = ConvexHull(corners).simplices
    return surface_points(TriangleMesh(corners.astype(np.float32), faces.astype(np.int32)), _POINTS_OF_PIECE)


def about_z(yaw: float) -> npt.NDArray[np.float64]:
    """Rotation (3, 3) by `yaw` [rad] about z."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def gripper_at(thing: PlanarPose, pinch: Pinch) -> PlanarPose:
    """The gripper that holds a thing lying at `thing` by that pinch."""
    c, s = math.cos(thing.yaw), math.sin(thing.yaw)
    return PlanarPose(
        thing.x + c * pinch.x - s * pinch.y,
        thing.y + s * pinch.x + c * pinch.y,
        thing.yaw + pinch.yaw,
    )
