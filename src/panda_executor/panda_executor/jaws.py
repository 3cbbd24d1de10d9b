"""The fingers over a cloud: where they touch an object, and their clearance on the way there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage

from panda_executor.errors import GraspError
from panda_executor.ground_cells import BoolArray, GroundCells
from panda_model import FloatArray, HandModel, load_preset

_SQUARE = np.ones((3, 3), dtype=bool)
_RISE = 0.002  # between two heights of the fingertips that are tried [m]
_GROWTH = 0.01  # how much wider a feature may become below the height at which it was recognised [m]
_NOISE = 0.0045  # what rises less above the floor is the floor [m]
_OPEN_CLEARANCE = 0.005  # beyond an opened finger, where there is that much [m]


@dataclass(frozen=True)
class JawConfig:
    """Settings of the jaws, lengths in m.

    hand: whose jaws they are; tip_clearance: fingertips to table;
    min_insertion: the tcp is at least this far below the object's top, where it is tall enough and nothing is
    in the way; least_insertion: of the fingertips, where something is; palm_clearance: palm to what is below;
    finger_margin: between a moving finger and what it must not touch.
    """

    hand: HandModel = field(default_factory=lambda: load_preset().hand)
    tip_clearance: float = 0.005
    min_insertion: float = 0.015
    least_insertion: float = 0.008
    palm_clearance: float = 0.005
    finger_margin: float = 0.002


@dataclass(frozen=True)
class Hold:
    """Fingers on an object, lengths in m.

    middle, across: of the fingers along and across the closing direction, seen from the pick; width: between them;
    opening: of them on the way down; tips: height of the fingertips; spare: how much higher they could be and
    still hold.
    """

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
        self._cells, self._config, self._hand = cells, config, config.hand
        self._floor, self._table_z = floor, table_z
        dx, dy = cells.x - x, cells.y - y
        self.along: FloatArray = dx * math.cos(yaw) + dy * math.sin(yaw)
        self.across: FloatArray = dy * math.cos(yaw) - dx * math.sin(yaw)
        self._top: FloatArray = np.where(cells.seen, cells.top, -np.inf)

    def on_object(self, part: BoolArray, height: float, where: str) -> Hold:
        """Return the fingers on the outsides of `part` (n, n), at its centroid across the closing direction.

        Args:
            height: of the middle of what is held, where the tcp should be [m].

        Raises:
            GraspError: when it is too wide there, or the fingers have no clearance.
        """
        across = float(self.across[part].mean())
        between = part & self._strip(across)
        if not between.any():
            raise GraspError(f"there is nothing between the fingers at the middle of the object at {where}")
        own = ndimage.binary_dilation(part, structure=_SQUARE)
        return self._descend(lambda tips: between, own, across, height, between, where)

    def on_feature(self, whole: BoolArray, reach: float, height: float, where: str) -> Hold | None:
        """Return the fingers on the narrow thing at the pick itself: a rim, a handle, a bead; None where there is none.

        Only what lies between the fingers as wide as they are counts, and is connected to the pick there. A gap
        into which no finger fits does not separate two parts of one object.

        Args:
            whole: the object's cells (n, n); reach: how far the feature may be from the pick [m].

        Raises:
            GraspError: when it is too wide, or the fingers have no clearance.
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
        """Return the deepest hold for which the fingers have clearance to go down and to close."""
        config, hand = self._config, self._hand
        top = float(np.percentile(self._top[between], 90.0))
        highest = top - config.least_insertion
        lowest = max(
            min(height, top - config.min_insertion) - hand.fingertip_below_tcp,
            self._table_z + config.tip_clearance,
            self._floor + _NOISE,
        )
        widest = hand.widest
        narrowest, highest_beside = math.inf, -math.inf
        for tips in np.append(np.arange(lowest, highest, _RISE), max(lowest, highest)):
            cells = touched(float(tips))
            middle, width = self._span(cells)
            narrowest = min(narrowest, width)
            beside = self._under_palm(middle, across)
            if width > widest or tips + hand.finger_length < beside + config.palm_clearance:
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
        if highest_beside + config.palm_clearance > highest + hand.finger_length:
            raise GraspError(
                f"what stands within {hand.palm_half_length * 1000:.0f} mm of the object at {where} is "
                f"{(highest_beside - top) * 1000:.0f} mm higher than it and in the way of the hand"
            )
        raise GraspError(f"there is no room for the fingers beside the object at {where}")

    def _opening(self, own: BoolArray, middle: float, across: float, width: float, tips: float) -> float | None:
        """Return the opening [m] from which both fingers close without touching what is higher than their tips."""
        config, hand = self._config, self._hand
        free = math.inf
        for height, thickness in _finger_parts(hand):
            level = max(tips + height - config.finger_margin, self._floor + _NOISE)
            blocked = self._cells.seen & ~own & (self._top > level)
            # A neighbour's lone cells are noise: what could stop a finger covers more than one cell.
            blocked &= ndimage.uniform_filter(blocked.astype(float), 3, mode="constant") > 1.5 / 9.0
            distance = np.abs(self.along[blocked & self._strip(across, config.finger_margin)] - middle)
            distance = distance[distance > width / 2.0 - config.finger_margin]
            nearest = float(distance.min()) if distance.size else math.inf
            free = min(free, nearest - self._cells.cell / 2.0 - thickness - width / 2.0)
        if free < hand.finger_slack + config.finger_margin:
            return None
        return min(width + 2.0 * max(free - _OPEN_CLEARANCE, free / 2.0), hand.opening)

    def _strip(self, across: float, margin: float = 0.0) -> BoolArray:
        """Return a mask of the cells that the fingers' width covers."""
        strip: BoolArray = np.abs(self.across - across) < self._hand.finger_half_width + margin
        return strip

    def _span(self, cells: BoolArray) -> tuple[float, float]:
        """Return middle and width [m] of cells along the closing direction."""
        low, high = float(self.along[cells].min()), float(self.along[cells].max())
        return (low + high) / 2.0, high - low  # the outermost of many cells are mostly empty

    def _run(self, strip: BoolArray, tips: float, reach: float) -> BoolArray | None:
        """Return the cells of the strip higher than `tips` that are connected along it to the pick."""
        high = strip & (self._top > tips)
        bins = np.round(self.along[high] / self._cells.cell).astype(np.int64)
        if not bins.size:
            return None
        filled = np.unique(bins)
        finger = (self._hand.finger_thickness + 2.0 * self._hand.finger_slack) / self._cells.cell
        groups = np.split(filled, np.flatnonzero(np.diff(filled) > finger) + 1)
        nearest = min(groups, key=lambda group: float(np.abs(group).min()))
        if np.abs(nearest).min() * self._cells.cell > reach:
            return None
        run = high.copy()
        run[high] = (bins >= nearest[0]) & (bins <= nearest[-1])
        return run

    def _under_palm(self, middle: float, across: float) -> float:
        """Return the height of the highest thing under the hand [m]."""
        under = np.abs(self.along - middle) < self._hand.palm_half_length
        under &= np.abs(self.across - across) < self._hand.palm_half_width
        return float(self._top[under].max())


def _finger_parts(hand: HandModel) -> tuple[tuple[float, float], ...]:
    """Return (underside's height above the fingertips, thickness along the closing direction) of pad and mount [m]."""
    return (
        (0.0, hand.finger_thickness),
        (hand.fingertip_below_tcp + hand.mount_above_tcp, hand.mount_thickness),
    )
