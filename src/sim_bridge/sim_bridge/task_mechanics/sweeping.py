"""The expert of sweeps: the next one that gathers small things in a square zone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cliport_core import PlanarPose, WorkspaceSpec
from sim_bridge.robot import HAND

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

HAND_WIDTH = HAND.closed_width  # across the motion [m]
HAND_DEPTH = HAND.closed_depth  # along the motion [m]
_BLOCK_EDGE = 0.01  # edge of a thing that is swept [m]
_PUSH_DISTANCE = HAND_DEPTH / 2 + _BLOCK_EDGE / 2  # between the middles of the hand and of a thing that it pushes [m]
_QUEUE_PITCH = 0.011  # between things pushed one before another [m]
_LANES = 3  # things side by side before the hand
_SLIP_CHANCE = 0.04  # probability that a thing slips past the hand, for each one between it and the hand
_RIM_WIDTH = 0.004  # things this near to the hand's edge may slip past it, too [m]
_RIM_SLIP_CHANCE = 0.3  # probability that they do
_SAFE_DEPTH = 0.009  # a thing this far inside the zone's edge counts fully [m]
_MAX_STARTS = 24  # things behind which a sweep may begin: the farthest ones outside the zone
_SIDE_SHIFTS = (-0.008, 0.0, 0.008)  # of the hand beside that thing [m]
_SHORT_OF_MIDDLE = 0.03  # the hand stops so far before the zone's middle: things lie ahead of it [m]
_JUST_INSIDE = 0.011  # or when the first thing is so far inside the zone's edge, where the last ones are swept in [m]
_EARLY_END = 0.5  # price of such an end, in things: policies learn the other one more easily
_WORKSPACE_MARGIN = 0.005  # of a sweep's start from the workspace's edge [m]
_BACK_STEPS, _BACK_STEP = 24, 0.005  # distances behind the first thing at which a sweep may begin [m]
_CLEARANCE = 0.01  # between a thing's middle and the hand that goes down beside it [m]
_MIN_WAY = 0.003  # of a sweep [m]
_BLOCKS_PER_METRE = 1.0  # price of a sweep's length, and of a thing's way to the zone, in things


def next_sweep(
    things: FloatArray, zone: PlanarPose, size: float, workspace: WorkspaceSpec
) -> tuple[PlanarPose, PlanarPose] | None:
    """Return the hand's start and end for the sweep that should leave the most of all things (N, 2) [m] in a square
    zone of edge `size` [m]; None when all lie inside, or the hand can go down nowhere."""
    square = _Zone(zone, size)
    worth = square.worth(things)
    outside = np.flatnonzero(worth < 1.0)
    firsts = things[outside[np.argsort(worth[outside], kind="stable")][:_MAX_STARTS]]
    sweeps = _Sweeps.towards(np.array([zone.x, zone.y]), firsts, _SIDE_SHIFTS)
    deep = sweeps.shortened(np.full(len(sweeps.length), _SHORT_OF_MIDDLE))
    early = sweeps.shortened(square.reach(sweeps.forth) - _JUST_INSIDE + _PUSH_DISTANCE)
    sweeps = deep.and_also(early)
    back = sweeps.run_ups(things, workspace)
    gain = sweeps.gain(things, back, square)
    gain[len(deep.length) :] -= _EARLY_END
    if not np.isfinite(gain).any():
        return None
    best = int(np.argmax(gain))
    forth = sweeps.forth[best]
    start, end = sweeps.start[best] - forth * back[best], sweeps.start[best] + forth * sweeps.length[best]
    yaw = math.remainder(math.atan2(forth[1], forth[0]) + math.pi / 2, math.pi)
    return PlanarPose(float(start[0]), float(start[1]), yaw), PlanarPose(float(end[0]), float(end[1]), yaw)


def met_by_sweep(things: FloatArray, start: PlanarPose, end: PlanarPose) -> BoolArray:
    """Return (N,) which things (N, 2) [m] the hand meets from start to end."""
    sweep = _Sweeps.towards(np.array([end.x, end.y]), np.array([[start.x, start.y]]))
    along, across = sweep.local(things)
    front = sweep.length[:, None] + HAND_DEPTH / 2
    met = (along > 0.0) & (along < front) & (abs(across) < HAND_WIDTH / 2)
    return np.asarray(met.any(axis=0))


@dataclass(frozen=True)
class _Zone:
    pose: PlanarPose
    size: float

    def worth(self, at: FloatArray) -> FloatArray:
        """Return the worth (...) of things at (..., 2) [m]: 1 well inside, less
        from the edge on, always less farther away."""
        local = np.abs(self._local(at))
        beyond = (local - self.size / 2).max(axis=-1)
        away = np.linalg.norm(np.maximum(local - self.size / 2, 0.0), axis=-1)
        worth: FloatArray = np.clip(0.5 - beyond / (2 * _SAFE_DEPTH), 0.0, 1.0) - _BLOCKS_PER_METRE * away
        return worth

    def reach(self, forth: FloatArray) -> FloatArray:
        """Return how far the zone's edge is from its middle in directions (C, 2), (C,) [m]."""
        reach: FloatArray = self.size / 2 / np.abs(forth @ self._turn()).max(axis=1)
        return reach

    def _local(self, at: FloatArray) -> FloatArray:
        return np.asarray((at - (self.pose.x, self.pose.y)) @ self._turn())

    def _turn(self) -> FloatArray:
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        return np.array([[c, -s], [s, c]])


@dataclass(frozen=True, eq=False)
class _Sweeps:
    """Candidates (C) of sweeps: the hand's middle moves in direction `forth` (C, 2) from behind `start` (C, 2), where
    the first thing is, until it is `length` [m] beyond that start (before it, where negative)."""

    start: FloatArray
    forth: FloatArray
    length: FloatArray

    @classmethod
    def towards(cls, middle: FloatArray, starts: FloatArray, shifts: tuple[float, ...] = (0.0,)) -> _Sweeps:
        """Return candidates through each start (F, 2), and beside it, which end at a middle (2,)."""
        way = middle - np.repeat(starts, len(shifts), axis=0)
        side = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.linalg.norm(way, axis=1), _MIN_WAY)[:, None]
        way -= np.tile(shifts, len(starts))[:, None] * side
        length = np.linalg.norm(way, axis=1)
        keep = length > _MIN_WAY
        way, length = way[keep], length[keep]
        return cls(middle - way, way / length[:, None], length)

    def shortened(self, by: FloatArray) -> _Sweeps:
        """Return those that still move their first thing when they end `by` (C,) [m] sooner."""
        length = self.length - by
        keep = length + _PUSH_DISTANCE > _MIN_WAY
        return _Sweeps(self.start[keep], self.forth[keep], length[keep])

    def and_also(self, others: _Sweeps) -> _Sweeps:
        """Return these candidates, then the others."""
        return _Sweeps(
            np.concatenate([self.start, others.start]),
            np.concatenate([self.forth, others.forth]),
            np.concatenate([self.length, others.length]),
        )

    def local(self, things: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return things (N, 2) as seen from each start: along the motion and to its left, (C, N) each [m]."""
        offset = things[None] - self.start[:, None]
        along = (offset * self.forth[:, None]).sum(axis=-1)
        return along, offset[..., 1] * self.forth[:, None, 0] - offset[..., 0] * self.forth[:, None, 1]

    def run_ups(self, things: FloatArray, workspace: WorkspaceSpec) -> FloatArray:
        """Return how far behind its start each hand can go down, (C,) [m]; infinite where it cannot."""
        along, across = self.local(things)
        along = np.where(np.abs(across) < HAND_WIDTH / 2 + _CLEARANCE, along, np.inf)
        found = np.full(len(self.length), np.inf)
        for step in range(_BACK_STEPS):
            back = _PUSH_DISTANCE + _CLEARANCE / 2 + step * _BACK_STEP
            at = self.start - self.forth * back
            blocked = (np.abs(along + back) < HAND_DEPTH / 2 + _CLEARANCE).any(axis=1)
            blocked |= ~workspace.contains(at, _WORKSPACE_MARGIN)
            found = np.where(np.isinf(found) & ~blocked, back, found)
        return found

    def gain(self, things: FloatArray, back: FloatArray, zone: _Zone) -> FloatArray:
        """Return the gain of each sweep, (C,) in things; minus infinity where the hand
        cannot go down `back` (C,) [m] behind the start."""
        along, across = self.local(things)
        front = (self.length + _PUSH_DISTANCE)[:, None]
        met = along > -back[:, None]
        caught = met & (np.abs(across) < HAND_WIDTH / 2)
        lane = np.where(caught, np.floor((across / HAND_WIDTH + 0.5) * _LANES), -1.0)
        before = np.zeros_like(along)  # of how many things between it and the hand each is pushed
        for number in range(_LANES):
            rank = np.argsort(np.argsort(np.where(lane == number, along, np.inf), axis=1), axis=1)
            before = np.where(lane == number, rank, before)
        ahead = np.where(caught, np.maximum(along, front + before * _QUEUE_PITCH), along)
        rim = met & (along < front) & (np.abs(np.abs(across) - HAND_WIDTH / 2) < _RIM_WIDTH)
        lost = np.where(rim, _RIM_SLIP_CHANCE, np.where(ahead > along, before * _SLIP_CHANCE, 0.0))
        left = np.stack([-self.forth[:, 1], self.forth[:, 0]], axis=-1)
        there = self.start[:, None] + ahead[..., None] * self.forth[:, None] + across[..., None] * left[:, None]
        gain = ((1.0 - lost) * zone.worth(there)).sum(axis=1) - zone.worth(things).sum()
        gain -= _BLOCKS_PER_METRE * (self.length + np.where(np.isfinite(back), back, 0.0))
        return np.where(np.isfinite(back), gain, -np.inf)
