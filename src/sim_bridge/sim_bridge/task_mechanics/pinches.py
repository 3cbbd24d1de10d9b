"""Pinches of parallel jaws for a thing as it lies: its shape's own, or found on its surface seen from above."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from cliport_core import PlanarPose
from sim_bridge.geometry.mesh import TriangleMesh
from sim_bridge.geometry.surface import surface_points
from sim_bridge.objects import Pinch, SceneObject, Shape
from sim_bridge.robot import BESIDE, HAND
from sim_bridge.world import SimWorld

FloatArray = npt.NDArray[np.float64]
Heights = npt.NDArray[np.float32]

_CELL = 0.003  # edge of a cell in the map of heights [m]
_N_YAWS = 18  # yaws that are tried, over half a turn
_JAW_CELLS = round(HAND.finger_width / _CELL)  # cells: width of the fingers
_APPROACH_CELLS = _JAW_CELLS + 4  # cells: width that they need free on their way down, two more on either side
_FINGER_CELLS = round(BESIDE / _CELL)  # cells beside the thing that an opened finger takes
_SLACK_CELLS = 1  # between an opened finger and the thing
_TOP_WINDOW_CELLS = 9  # edge of the window in which the top around a pick is looked for
_PAD_LENGTH = HAND.pad_length  # the jaws touch a thing at most this far below its top [m]
_TIP_DEPTH = HAND.fingertip_below_tcp + 0.015  # of the fingertips below the top at most; of the tcp: 15 mm [m]
_TIP_CLEARANCE = 0.005  # of the fingertips above the ground of the thing at least [m]
_MAX_WIDTH = HAND.widest - 0.007  # of a pinch: a thing may be wider than its cells by one on either side [m]
_MIN_HELD_HEIGHT = 0.009  # of a thing between the fingers [m]
FARTHEST = 0.025  # distance of a good pinch from the centre of mass at most [m]
_CENTRE_OFFSET_SCALE = 0.030  # offset from the centre of mass that costs as much as a jaw without contact [m]
_UPPER_OFFSET_SCALE = 0.040  # offset from the upper side's middle, along the jaws, of the same cost [m]
_WIDTH_SCALE = 0.10  # width of the same cost [m]
_MIN_YAW_DIFFERENCE = math.radians(18.0)  # between two pinches [rad]
_COST_RANGE = 0.8  # pinches that cost more than this above the best one are left out
_MAX_PINCHES = 6  # of a thing
_MAX_PER_YAW = 8  # pinches at one yaw, the nearest to the centre of mass

_MESH_POINTS = 8000  # points on the visible surface of a thing
_PIECE_POINTS = 800  # points on a convex piece of its collision shape
OUTERMOST = 0.06  # distance of a pinch from the centre of mass where there is no good one [m]
_UPRIGHT_COSINE = 0.98  # a body whose z axis has a larger vertical part stands upright


def pinches_of(world: SimWorld, thing: SceneObject) -> list[Pinch]:
    """Return the pinches of a thing relative to its planar pose (SimWorld.planar_pose), best first.

    An upright one is held as its shape says, where it does; any other where a search finds it narrow and free.
    """
    pose = world.object_pose(thing)
    if thing.shape.pinches and pose.rotation[2, 2] > _UPRIGHT_COSINE:
        return list(thing.shape.pinches)
    upright = PlanarPose(0.0, 0.0, -world.planar_pose(thing).yaw).as_pose()
    rotation = upright.rotation @ pose.rotation
    return pinches_lying(thing.shape, rotation) or pinches_lying(thing.shape, rotation, farthest=OUTERMOST)


def pinches_lying(shape: Shape, rotation: FloatArray, farthest: float = FARTHEST) -> list[Pinch]:
    """Return pinches of a shape that lies turned by `rotation` (3, 3), best first: where it, as seen and as it
    collides, is narrow and free, nearer to its centre of mass than `farthest` [m]."""
    points = [surface_points(shape.mesh, _MESH_POINTS)]
    if shape.collision is not None:
        points += [_hull_points(part.corners) for part in shape.collision.parts]
    return search_pinches(np.concatenate(points) @ rotation.T, farthest)


def gripper_at(thing: PlanarPose, pinch: Pinch) -> PlanarPose:
    """Return the gripper that holds a thing lying at `thing` by that pinch."""
    c, s = math.cos(thing.yaw), math.sin(thing.yaw)
    return PlanarPose(
        thing.x + c * pinch.x - s * pinch.y,
        thing.y + s * pinch.x + c * pinch.y,
        thing.yaw + pinch.yaw,
    )


def search_pinches(points: FloatArray, farthest: float = FARTHEST) -> list[Pinch]:
    """Find good pinches of a thing, best first: near its centre of mass, with contacts that face each other.

    points: (N, 3) of its surface [m], upright, its centre of mass at x = y = 0. Empty where nothing nearer to that
    than `farthest` [m] is narrow and free enough.
    """
    bottom = float(points[:, 2].min())
    found: list[tuple[float, Pinch]] = []
    for yaw in np.arange(_N_YAWS) * (math.pi / _N_YAWS):
        found += _pinches_at(points, float(yaw), bottom, farthest)
    found.sort(key=lambda item: item[0])
    chosen: list[Pinch] = []
    for cost, pinch in found:
        if cost > found[0][0] + _COST_RANGE or len(chosen) == _MAX_PINCHES:
            break
        if all(abs(math.remainder(pinch.yaw - other.yaw, math.pi)) > _MIN_YAW_DIFFERENCE for other in chosen):
            chosen.append(pinch)
    return chosen


def _pinches_at(points: FloatArray, yaw: float, bottom: float, farthest: float) -> list[tuple[float, Pinch]]:
    """Return pinches that close at one yaw, the nearest to the centre of mass, with their costs."""
    c, s = math.cos(yaw), math.sin(yaw)
    along, across = points[:, 0] * c + points[:, 1] * s, points[:, 1] * c - points[:, 0] * s
    heights, (row_0, col_0) = _heights(along, across, points[:, 2])
    tops = cv2.dilate(heights, np.ones((_TOP_WINDOW_CELLS, _TOP_WINDOW_CELLS), dtype=np.uint8))
    levels = np.maximum(tops - _TIP_DEPTH, bottom + _TIP_CLEARANCE)
    good = heights > np.maximum(tops - _PAD_LENGTH, levels + _MIN_HELD_HEIGHT)
    rows, cols = np.nonzero(good)
    near = (np.hypot(rows - row_0, cols - col_0) * _CELL < farthest) & (rows % 2 == row_0 % 2)
    rows, cols = rows[near], cols[near]
    jaws, ways = (cv2.dilate(heights, np.ones((n, 1), dtype=np.uint8))[rows] for n in (_JAW_CELLS, _APPROACH_CELLS))
    limit = levels[rows, cols][:, None]
    first, last, free = _runs(jaws > limit, ways > limit, cols)
    width, middle = (last - first) * _CELL, ((first + last) / 2 - col_0) * _CELL
    beside = (rows - row_0) * _CELL
    distance = np.hypot(middle, beside)
    free &= (width <= _MAX_WIDTH) & (distance < farthest)
    found: dict[tuple[int, int, int], tuple[float, Pinch]] = {}
    for i in np.flatnonzero(free)[np.argsort(distance[free], kind="stable")]:
        run = (int(rows[i]), int(first[i]), int(last[i]))
        if run not in found and len(found) < _MAX_PER_YAW:
            jaw = heights[rows[i] - _JAW_CELLS // 2 : rows[i] + _JAW_CELLS // 2 + 1] > levels[rows[i], cols[i]]
            upper = np.nonzero(heights > tops[rows[i], cols[i]] - _PAD_LENGTH)[0]
            along_jaws = abs(float(upper.mean()) - rows[i]) * _CELL
            cost = (
                float(distance[i]) / _CENTRE_OFFSET_SCALE
                + along_jaws / _UPPER_OFFSET_SCALE
                + float(width[i]) / _WIDTH_SCALE
            )
            cost += _unevenness(jaw, run[1], run[2])
            x, y = middle[i] * c - beside[i] * s, middle[i] * s + beside[i] * c
            found[run] = (cost, Pinch(float(x), float(y), yaw, float(width[i])))
    return list(found.values())


def _heights(along: FloatArray, across: FloatArray, z: FloatArray) -> tuple[Heights, tuple[int, int]]:
    """Return the highest point in each cell, rows across and columns along, and the cell of the centre of mass."""
    margin = _FINGER_CELLS + _JAW_CELLS
    low_row, low_col = (math.floor(float(v.min()) / _CELL) - margin for v in (across, along))
    rows, cols = (np.floor(v / _CELL).astype(np.intp) - low for v, low in ((across, low_row), (along, low_col)))
    heights = np.full((rows.max() + margin + 1, cols.max() + margin + 1), -1.0, dtype=np.float32)
    np.maximum.at(heights, (rows, cols), z.astype(np.float32))
    return heights, (-low_row, -low_col)


def _runs(
    taken: npt.NDArray[np.bool_], in_way: npt.NDArray[np.bool_], cols: npt.NDArray[np.intp]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Return, for each row (N, columns), the first and last taken cell around its column in cols (N,), and whether the
    opened fingers beside both are free."""
    index = np.arange(taken.shape[1])
    first = np.where(~taken & (index < cols[:, None]), index, -1).max(axis=1, initial=-1) + 1
    last = np.where(~taken & (index > cols[:, None]), index, len(index)).min(axis=1, initial=len(index)) - 1
    low, high = first[:, None] - _SLACK_CELLS, last[:, None] + _SLACK_CELLS
    fingers = ((index < low) & (index >= low - _FINGER_CELLS)) | ((index > high) & (index <= high + _FINGER_CELLS))
    return first, last, ~(in_way & fingers).any(axis=1)


def _unevenness(taken: npt.NDArray[np.bool_], first: int, last: int) -> float:
    """Return the share of the jaws' width that is not near the thing, 0 (flat, facing contacts) to 2."""
    left = taken[:, first : first + 2].any(axis=1).mean()
    right = taken[:, last - 1 : last + 1].any(axis=1).mean()
    return float(2.0 - left - right)


def _hull_points(corners: FloatArray) -> FloatArray:
    faces = ConvexHull(corners).simplices
    return surface_points(TriangleMesh(corners.astype(np.float32), faces.astype(np.int32)), _PIECE_POINTS)
