"""The object that a pick means, as cells, and what it stands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cliport_core.pose import PlanarPose
from panda_executor.errors import GraspError
from panda_executor.ground_cells import LEVEL, STEP, BoolArray, GroundCells, IntArray
from panda_model.limits import FloatArray

_MIN_CELLS = 4  # of an object
_PEG_AREA = 1.9e-4  # what is smaller and stands in a hole is a peg [m^2]; a rope's bead is larger
_NEAR_TOP = 0.015  # the object's top is taken this near to the pick [m]
_LEVEL_SHARE = 0.3  # of what is seen around an object, for a surface on which it stands
_BASE_HEIGHT = 0.012  # a surface no higher above the table is a base, a kit or a box's floor [m]
_STACKED_SHARE = 0.35  # an object that covers less of what it stands on is a part of that, as a handle is
_MAX_MOVABLE = 0.17  # what is larger stands still, whatever is on it [m]


@dataclass(frozen=True, eq=False)
class SeenObject:
    """The object at a pick as cells (n, n).

    upper: what lies within a finger's reach of its top; whole: all of it, as far as it is known to move along;
    top, support_z: of its upper part, and of what it stands on [m].
    """

    upper: BoolArray
    whole: BoolArray
    top: float
    support_z: float


def find_object(
    cells: GroundCells,
    pick: PlanarPose,
    table_z: float,
    finger_height: float,
    min_height: float,
    reach: float,
    divided: bool = True,
) -> SeenObject:
    """Find the object at the pick, or around the pick where that is in a hole.

    Args:
        finger_height: how far below its top an object is looked at [m]; min_height: what rises less above
            the table is flat [m]; reach: how far the object may be from the pick [m];
            divided: whether a step parts objects.

    Raises:
        GraspError: when nothing stands there.
    """
    where = f"the pick ({pick.x:.3f}, {pick.y:.3f}) m"
    raised = cells.seen & (np.nan_to_num(cells.top, nan=-1.0) > table_z + min_height)
    labels = cells.parts(raised & ~_feet(cells) if divided else raised)
    labels[np.bincount(labels.ravel())[labels] < _MIN_CELLS] = 0
    distance = np.hypot(cells.x - pick.x, cells.y - pick.y)
    label = _label_at(labels, distance, reach, cells.cell)
    if label == 0:
        raise GraspError(f"nothing rises more than {min_height * 1000:.0f} mm above the table at {where}")
    part = labels == label
    near = part & (distance <= float(distance[part].min()) + _NEAR_TOP)
    top = float(np.percentile(cells.top[near], 95.0))
    lowest = max(top - finger_height, table_z + min_height / 2.0)
    upper = cells.component(part & (cells.top >= lowest), pick.x, pick.y, np.inf)
    assert upper is not None  # the top itself is within
    support_z, whole = _support(cells, part, raised, top, table_z)
    return SeenObject(upper, whole, top, support_z)


def _feet(cells: GroundCells) -> BoolArray:
    """Return the cells at the foot of something: much lower than one beside them."""
    top = np.where(cells.seen, cells.top, -np.inf)
    feet: BoolArray = cells.seen & (top < ndimage.maximum_filter(top, size=3) - STEP)
    return feet


def _label_at(labels: IntArray, distance: FloatArray, reach: float, cell: float) -> int:
    """Return the part nearest to the pick, or the one around it where the nearest is only a peg; 0: none."""
    reachable = np.where(labels > 0, distance, np.inf)
    nearest = np.unravel_index(int(np.argmin(reachable)), labels.shape)
    if reachable[nearest] > reach:
        return 0
    label = int(labels[nearest])
    if (labels == label).sum() * cell * cell >= _PEG_AREA:
        return label
    near = np.unique(labels[reachable <= 2.0 * reach])
    for other in sorted(near, key=lambda other: float(distance[labels == other].min())):
        part = labels == other
        if part.sum() * cell * cell >= _PEG_AREA and _filled(part)[nearest]:
            return int(other)
    return label


def _filled(part: BoolArray) -> BoolArray:
    """Return a part with its holes; a rim may have small gaps."""
    closed = ndimage.binary_closing(np.pad(part, 3), structure=np.ones((3, 3)), iterations=2)
    filled: BoolArray = ndimage.binary_fill_holes(closed)[3:-3, 3:-3] | part
    return filled


def _support(
    cells: GroundCells, part: BoolArray, raised: BoolArray, top: float, table_z: float
) -> tuple[float, BoolArray]:
    """Return the height that an object stands on [m], and its cells with those that are one with it beneath.

    A level surface right beside the object is what it stands on. It may be narrow, as the ledge of a wider ring
    is. Where the object covers but little of it, the two are one: a box and its handle. Where there is none,
    everything connected is one: a figure's head and shoulders.
    """
    filled = _filled(part)
    level = _level_beside(cells, filled, top, table_z)
    if level is not None and level <= table_z + _BASE_HEIGHT:
        return level, part
    if level is None:
        labels = cells.parts(raised)
        whole = np.isin(labels, np.unique(labels[part]))
    else:
        whole = part | _ledge(cells, filled, level)
    outline = _filled(whole)
    stacked = level is not None and filled.sum() >= _STACKED_SHARE * outline.sum()
    if stacked or max(float(np.ptp(axis[outline])) for axis in (cells.x, cells.y)) > _MAX_MOVABLE:
        return _lowest_around(cells, filled, table_z) if level is None else level, part
    below = _level_beside(cells, outline, top, table_z)
    return _lowest_around(cells, outline, table_z) if below is None else below, whole


def _level_beside(cells: GroundCells, filled: BoolArray, top: float, table_z: float) -> float | None:
    """Return the height of the highest level surface below `top` [m] right beside an object, or None."""
    heights = np.sort(cells.top[_ring(filled, 0, 2) & cells.seen])[::-1]
    heights = heights[heights < top - STEP]
    if len(heights) < 8:
        return table_z
    # how many of the heights lie within the one surface that begins with each of them
    ends = np.searchsorted(-heights, -(heights - 2.0 * LEVEL), side="right")
    full = np.flatnonzero(ends - np.arange(len(heights)) >= _LEVEL_SHARE * len(heights))
    if not len(full):
        return None
    first = int(full[0])
    level = float(np.median(heights[first : ends[first]]))
    return level if level > table_z + LEVEL else table_z


def _lowest_around(cells: GroundCells, filled: BoolArray, table_z: float) -> float:
    """Return the low part of what is seen in a wider ring around the object, else the table [m]."""
    heights = cells.top[_ring(filled, 2, 5) & cells.seen]
    if heights.size < 10:
        return table_z
    level = float(np.percentile(heights, 20.0))
    return level if level > table_z + 2.0 * LEVEL else table_z


def _ledge(cells: GroundCells, filled: BoolArray, level: float) -> BoolArray:
    """Return the cells of the level surface around the object."""
    flat = cells.seen & ~filled & (np.abs(np.nan_to_num(cells.top, nan=-1.0) - level) < 2.0 * LEVEL)
    labels = cells.parts(flat)
    touching = np.unique(labels[_ring(filled, 0, 3)])
    ledge: BoolArray = np.isin(labels, touching[touching > 0])
    return ledge


def _ring(filled: BoolArray, inner: int, outer: int) -> BoolArray:
    """Return the cells more than `inner` and up to `outer` cells away."""
    within = ndimage.binary_dilation(filled, structure=np.ones((3, 3)), iterations=inner) if inner else filled
    ring: BoolArray = ndimage.binary_dilation(filled, structure=np.ones((3, 3)), iterations=outer) & ~within
    return ring
