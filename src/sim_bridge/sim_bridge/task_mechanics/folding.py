"""The expert of ropes: which bead to pinch, how, and where to drag it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from cliport_core import PickPlaceAction, PlanarPose, Primitive
from sim_bridge.robot import HAND

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

_SLOT_TOLERANCE = 0.01  # a bead nearer to its slot stays where it is [m]
_BEAD_RADIUS = 0.008  # of a bead, with a margin [m]
DISTANCE_PER_CAUGHT_BEAD = 0.03  # a bead this much farther from its slot is worth catching one more beside it [m]
_TILTS = tuple(math.radians(a) for a in (0, 15, -15, 30, -30, 45, -45))  # of the jaws from straight across [rad]


def next_fold(
    beads: FloatArray, slots: FloatArray, in_vain: IntArray | None = None
) -> tuple[int, PickPlaceAction | None]:
    """Return the bead to take to its slot, an end or else one that is far from it, and the action;
    beads and slots (20, 2) [m] in their order along the rope.

    Once both ends lie right, the rope between them is nearly straight. Slots count from the end that fits better. The
    jaws close across the rope, where the opened fingers meet few other beads. in_vain: how often each bead (20,) was
    tried for nothing; one that was tried less is better. No action when every bead lies right.
    """
    slots = min((slots, slots[::-1]), key=lambda s: float(np.linalg.norm(beads - s, axis=1).sum()))
    distance = np.linalg.norm(beads - slots, axis=1)
    tries = np.zeros(len(beads), int) if in_vain is None else in_vain
    ways: list[tuple[tuple[int, float], int, float]] = []
    wrong = np.flatnonzero(distance >= _SLOT_TOLERANCE).tolist()
    ends = [i for i in wrong if i in (0, len(beads) - 1) and tries[i] == tries.min()]
    for i in ends or wrong:
        tangent = _tangent(beads, i)
        for tilt in _TILTS:
            caught = _caught(beads, i, tangent + math.pi / 2 + tilt)
            ways.append(((-int(tries[i]), distance[i] - DISTANCE_PER_CAUGHT_BEAD * caught), i, tilt))
    if not ways:
        return -1, None
    _, i, tilt = max(ways, key=lambda way: way[0])
    return i, fold_to(beads, i, slots, i, tilt)


def fold_to(beads: FloatArray, i: int, slots: FloatArray, slot: int, tilt: float = 0.0) -> PickPlaceAction:
    """Return the action that takes bead i to a slot and turns the rope there as the slots run; tilt [rad]: of the jaws
    from straight across the rope. beads, slots: as next_fold's."""
    tangent = _tangent(beads, i)
    along = math.atan2(*(slots[-1] - slots[0])[::-1])
    yaw = math.remainder(tangent + math.pi / 2 + tilt, math.pi)
    turn = math.remainder(along - tangent, math.tau)
    turn = max(-math.pi / 2, min(math.pi / 2, turn))
    return PickPlaceAction(
        PlanarPose(float(beads[i, 0]), float(beads[i, 1]), yaw),
        PlanarPose(float(slots[slot, 0]), float(slots[slot, 1]), yaw + turn),
        Primitive.FOLD,
    )


def _tangent(beads: FloatArray, i: int) -> float:
    before, after = beads[max(i - 1, 0)], beads[min(i + 1, len(beads) - 1)]
    return math.atan2(*(after - before)[::-1])


def _caught(beads: FloatArray, i: int, yaw: float) -> int:
    """Count the other beads under the opened fingers that close at bead i in direction `yaw` [rad]."""
    offset = np.delete(beads, i, axis=0) - beads[i]
    closing = np.abs(offset @ np.array([math.cos(yaw), math.sin(yaw)]))
    across = np.abs(offset @ np.array([-math.sin(yaw), math.cos(yaw)]))
    opening = HAND.fold_opening
    inner, outer = opening / 2 - _BEAD_RADIUS, opening / 2 + HAND.finger_thickness + _BEAD_RADIUS
    return int(((closing > inner) & (closing < outer) & (across < HAND.finger_half_width + _BEAD_RADIUS)).sum())
