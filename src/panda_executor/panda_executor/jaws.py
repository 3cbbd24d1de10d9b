"""Where the fingers touch an object, and whether they come there without touching anything else."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from panda_executor.errors import GraspError
from panda_executor.ground_cells import BoolArray, GroundCells
from panda_executor.hand_geometry import (
    FINGER_HALF_WIDTH,
    FINGER_THICKNESS,
    FINGERTIP_BELOW_TCP,
    HAND_HALF_LENGTH,
    HAND_HALF_WIDTH,
    MAX_OPENING,
    MOUNT_ABOVE_TCP,
    MOUNT_THICKNESS,
    PALM_ABOVE_TCP,
)
from panda_executor.limits import FloatArray

_SQUARE = np.ones((3, 3), dtype=bool)
_FINGER_LENGTH = FINGERTIP_BELOW_TCP + PALM_ABOVE_TCP
_FINGER_PARTS = (  # underside above the fingertips, and thickness along the closing direction [m]
    (0.0, FINGER_THICKNESS),
    (FINGERTIP_BELOW_TCP + MOUNT_ABOVE_TCP, MOUNT_THICKNESS),
)
_RISE = 0.002  # between two heights of the fingertips that are tried [m]
_GROWTH = 0.01  # how much wider a feature may become below the height at which it was recognised [m]
_NOISE = 0.0045  # what rises less above the floor is the floor [m]
_AWAY = 0.005  # free space beyond an opened finger, where there is that much [m]


@dataclass(frozen=True)
class JawConfig:
    """Lengths in m.

    slack: free space that each finger needs beside the object; tip_clearance: fingertips to table;
    min_insertion: the tcp is at least this far below the object's top, where it is tall enough and nothing is
    in the way; least_insertion: of the fingertips, where something is; palm_clearance: palm to what is below;
    finger_margin: between a moving finger and what it must not touch.
    """

    slack: float = 0.0025
    tip_clearance: float = 0.005
    min_insertion: float = 0.015
    least_insertion: float = 0.008
    palm_clearance: float = 0.005
    finger_margin: float = 0.002


@dataclass(frozen=True)
class Hold:
    """Fingers on an object: their middle along the closing direction, and where they are across, seen from the
    pick [m]; width between them, opening on the way down, tips: height of the fingertips, spare: how much
    higher they could be and still hold [m]."""

    middle: float
    across: float
    width: float
    opening: float
    tips: float
    spare: float


Touched = Callable[[float], BoolArray]  # fingertips' height [m] -> cells (n, n) that the closed fingers touch


class Jaws:
    """The fingers over a cloud's cells, closing in one direction.

    Args:
        x, y, yaw: of the pick; yaw is the direction in which the fingers close [m, rad].
        floor: what the object stands on [m]; table_z: of the table [m].
    """

    def __init__(
        self, cells: GroundCells, x: float, y: float, yaw: float, floor: float, table_z: float, config: JawConfig
    ) -> None:
        self._cells, self._config = cells, config
        self._floor, self._table_z = floor, table_z
        dx, dy = cells.x - x, cells.y - y
        self.along: FloatArray = dx * math.cos(yaw) + dy * math.sin(yaw)
        self.across: FloatArray = dy * math.cos(yaw) - dx * math.sin(yaw)
        self._top: FloatArray = np.where(cells.seen, cells.top, -np.inf)

    def on_object(self, part: BoolArray, height: float, where: str) -> Hold:
        """The fingers on the outsides of `part` (n, n), at its centroid across the closing direction.

        Args:
            height: of the middle of what is held, where the tcp should be [m].

        Raises:
            GraspError: when it is too wide there, or there is no room for the fingers.
        """
        across = float(self.across[part].mean())
        between = part & self._strip(across)
        if not between.any():
            raise GraspError(f"there is nothing between the fingers at the middle of the object at {where}")
        own = ndimage.binary_dilation(part, structure=_SQUARE)
        return self._descend(lambda tips: between, own, across, height, between, where)

    def on_feature(self, whole: BoolArray, reach: float, height: float, where: str) -> Hold | None:
        """The fingers on the narrow thing at the pick itself: a rim, a handle, a bead. None: nothing is there.

        Only what lies between the fingers as wide as they are counts, and is connected to the pick there. A gap
        into which no finger fits does not separate two parts of one object.

        Args:
            whole: the object's cells (n, n); reach: how far the feature may be from the pick [m].

        Raises:
            GraspError: when it is too wide, or there is no room for the fingers.
        """
        strip = (
            self._strip(0.0, self._config.finger_margin)
            & ndimage.binary_dilation(whole, structure=_SQUARE)
            & self._cells.seen
        )
        at_pick = strip & (np.hypot(self.along, self.across) <= reach)
        if not at_pick.any():
            return None
        top = float(np.percentile(self._top[at_pick], 90.0))
        narrow = self._run(strip, top - self._config.least_insertion, reach)
        if narrow is None:
            return None
        limit = self._span(narrow)[1] + _GROWTH

        def touched(tips: float) -> BoolArray:
            run = self._run(strip, tips, reach)
            return narrow if run is None or self._span(run)[1] > limit else run

        return self._descend(touched, None, 0.0, height, narrow, where)

    def _descend(
        self, touched: Touched, own: BoolArray | None, across: float, height: float, between: BoolArray, where: str
    ) -> Hold:
        """The deepest hold for which the fingers have room to go down and to close."""
        config = self._config
        top = float(np.percentile(self._top[between], 90.0))
        highest = top - config.least_insertion
        lowest = max(
            min(height, top - config.min_insertion) - FINGERTIP_BELOW_TCP,
            self._table_z + config.tip_clearance,
            self._floor + _NOISE,
        )
        widest = MAX_OPENING - 2.0 * config.slack
        narrowest, highest_beside = math.inf, -math.inf
        for tips in np.append(np.arange(lowest, highest, _RISE), max(lowest, highest)):
            cells = touched(float(tips))
            middle, width = self._span(cells)
            narrowest = min(narrowest, width)
            beside = self._under_palm(middle, across)
            if width > widest or tips + _FINGER_LENGTH < beside + config.palm_clearance:
                highest_beside = max(highest_beside, beside)
                continue
            mine = own if own is not None else ndimage.binary_dilation(cells, structure=_SQUARE)
            opening = self._opening(mine, middle, across, width, float(tips))
            if opening is not None:
                return Hold(middle, across, width, opening, float(tips), max(highest - float(tips), 0.0))
        if narrowest > widest:
            raise GraspError(
                f"the object at {where} is {narrowest * 1000:.0f} mm wide between the fingers, "
                f"{widest * 1000:.0f} mm is the most that can be held"
            )
        if highest_beside + config.palm_clearance > highest + _FINGER_LENGTH:
            raise GraspError(
                f"what stands within {HAND_HALF_LENGTH * 1000:.0f} mm of the object at {where} is "
                f"{(highest_beside - top) * 1000:.0f} mm higher than it and in the way of the hand"
            )
        raise GraspError(f"there is no room for the fingers beside the object at {where}")

    def _opening(self, own: BoolArray, middle: float, across: float, width: float, tips: float) -> float | None:
        """The opening [m] from which both fingers close without touching what is higher than their tips."""
        config = self._config
        free = math.inf
        for height, thickness in _FINGER_PARTS:
            level = max(tips + height - config.finger_margin, self._floor + _NOISE)
            blocked = self._cells.seen & ~own & (self._top > level)
            # A neighbour's lone cells are noise: what could stop a finger covers more than one cell.
            blocked &= ndimage.uniform_filter(blocked.astype(float), 3, mode="constant") > 1.5 / 9.0
            distance = np.abs(self.along[blocked & self._strip(across, config.finger_margin)] - middle)
            distance = distance[distance > width / 2.0 - config.finger_margin]
            nearest = float(distance.min()) if distance.size else math.inf
            free = min(free, nearest - self._cells.cell / 2.0 - thickness - width / 2.0)
        if free < config.slack + config.finger_margin:
            return None
        return min(width + 2.0 * max(free - _AWAY, free / 2.0), MAX_OPENING)

    def _strip(self, across: float, margin: float = 0.0) -> BoolArray:
        """What the fingers' width covers."""
        strip: BoolArray = np.abs(self.across - across) < FINGER_HALF_WIDTH + margin
        return strip

    def _span(self, cells: BoolArray) -> tuple[float, float]:
        """Middle and width [m] of cells along the closing direction."""
        low, high = float(self.along[cells].min()), float(self.along[cells].max())
        return (low + high) / 2.0, high - low  # the outermost of many cells are mostly empty

    def _run(self, strip: BoolArray, tips: float, reach: float) -> BoolArray | None:
        """The cells of the strip higher than `tips` that are connected along it to the pick."""
        high = strip & (self._top > tips)
        bins = np.round(self.along[high] / self._cells.cell).astype(np.int64)
        if not bins.size:
            return None
        filled = np.unique(bins)
        finger = (FINGER_THICKNESS + 2.0 * self._config.slack) / self._cells.cell
        groups = np.split(filled, np.flatnonzero(np.diff(filled) > finger) + 1)
        nearest = min(groups, key=lambda group: float(np.abs(group).min()))
        if np.abs(nearest).min() * self._cells.cell > reach:
            return None
        run = high.copy()
        run[high] = (bins >= nearest[0]) & (bins <= nearest[-1])
        return run

    def _under_palm(self, middle: float, across: float) -> float:
        """The highest thing under the hand [m]."""
        under = np.abs(self.along - middle) < HAND_HALF_LENGTH
        under &= np.abs(self.across - across) < HAND_HALF_WIDTH
        return float(self._top[under].max())
