"""Where to sweep next, so that small things gather in a square zone."""

from __future__ import annotations

import itertools
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
_THING = 0.01  # edge of what is swept [m]
_TO_THING = HAND_DEPTH / 2 + _THING / 2  # from the hand's middle to that of a thing that it pushes [m]
_PITCH = 0.011  # of things that are pushed one before another [m]
_LANES = 3  # of things side by side before the hand
_LOST = 0.04  # chance, for each thing that is pushed before another, to slip past the hand
_RIM = 0.004  # what lies this near to the hand's edge may slip past it, too [m]
_RIM_LOST = 0.3
_SAFE = 0.009  # a thing this far inside the zone's edge is there to stay [m]
_FIRSTS = 24  # things outside, the farthest ones, behind which a sweep may begin
_SHIFTS = (-0.008, 0.0, 0.008)  # of the hand to the side of that thing [m]
_ENDS = 4  # places along each axis of the zone to which things may be brought
_EDGE = 0.011  # these places are that far inside the zone's edge [m]
_BORDER = 0.005  # along the workspace's edge, where no sweep begins [m]
_BACK_STEPS, _BACK_STEP = 24, 0.005  # how far behind the first thing a sweep may begin [m]
_FREE = 0.01  # from the middle of a thing to the hand that goes down beside it [m]
_SHORTEST = 0.003  # way of a thing [m]
_PER_METRE = 1.0  # how many things a sweep's length [m] must be worth, and a thing's way to the zone


def next_sweep(
    things: FloatArray, zone: PlanarPose, size: float, workspace: WorkspaceSpec
) -> tuple[PlanarPose, PlanarPose] | None:
    """The hand's start and end for the sweep that should leave the most of all things (N, 2) [m] in a square zone of
    edge `size` [m]; None when all lie inside, or the hand finds no room to go down."""
    square = _Zone(zone, size)
    worth = square.worth(things)
    outside = np.flatnonzero(worth < 1.0)
    firsts = things[outside[np.argsort(worth[outside], kind="stable")][:_FIRSTS]]
    sweeps = _Sweeps.between(firsts, square.places(firsts))
    back = sweeps.run_ups(things, workspace)
    gain = sweeps.gain(things, back, square)
    if not np.isfinite(gain).any():
        return None
    best = int(np.argmax(gain))
    forth = sweeps.forth[best]
    start, end = sweeps.start[best] - forth * back[best], sweeps.start[best] + forth * sweeps.length[best]
    yaw = math.remainder(math.atan2(forth[1], forth[0]) + math.pi / 2, math.pi)
    return PlanarPose(float(start[0]), float(start[1]), yaw), PlanarPose(float(end[0]), float(end[1]), yaw)


def on_the_way(things: FloatArray, start: PlanarPose, end: PlanarPose) -> BoolArray:
    """Which things (N, 2) [m] the hand meets from start to end."""
    sweep = _Sweeps.between(np.array([[start.x, start.y]]), np.array([[[end.x, end.y]]]), shifts=(0.0,))
    along, across = sweep.local(things)
    front = (sweep.length + _TO_THING)[:, None] + HAND_DEPTH / 2
    met = (along > 0.0) & (along < front) & (abs(across) < HAND_WIDTH / 2)
    return np.asarray(met.any(axis=0))


@dataclass(frozen=True)
class _Zone:
    pose: PlanarPose
    size: float

    def places(self, things: FloatArray) -> FloatArray:
        """(N, M, 2) to which each thing (N, 2) may be brought: the nearest place, then some all over the zone [m]."""
        reach = self.size / 2 - _EDGE
        steps = np.linspace(-reach, reach, _ENDS)
        spread = np.array(list(itertools.product(steps, steps)))
        nearest = np.clip(self._local(things), -reach, reach)
        local = np.concatenate([nearest[:, None], np.tile(spread, (len(things), 1, 1))], axis=1)
        return local @ self._turn().T + (self.pose.x, self.pose.y)

    def worth(self, at: FloatArray) -> FloatArray:
        """(...) of things at (..., 2) [m]: 1 well inside, less from the edge on, always less farther away."""
        local = np.abs(self._local(at))
        beyond = (local - self.size / 2).max(axis=-1)
        away = np.linalg.norm(np.maximum(local - self.size / 2, 0.0), axis=-1)
        worth: FloatArray = np.clip(0.5 - beyond / (2 * _SAFE), 0.0, 1.0) - _PER_METRE * away
        return worth

    def _local(self, at: FloatArray) -> FloatArray:
        return np.asarray((at - (self.pose.x, self.pose.y)) @ self._turn())

    def _turn(self) -> FloatArray:
        c, s = math.cos(self.pose.yaw), math.sin(self.pose.yaw)
        return np.array([[c, -s], [s, c]])


@dataclass(frozen=True, eq=False)
class _Sweeps:
    """Candidates (C): the hand's middle goes from behind `start` (C, 2), where the first thing is, in direction `forth`
    (C, 2) until it is `length` [m] beyond that start (before it, where negative)."""

    start: FloatArray
    forth: FloatArray
    length: FloatArray

    @classmethod
    def between(cls, starts: FloatArray, ends: FloatArray, shifts: tuple[float, ...] = _SHIFTS) -> _Sweeps:
        """Each start (F, 2) to its ends (F, M, 2) for a thing that is pushed, the hand shifted to either side."""
        start = np.repeat(starts, ends.shape[1] * len(shifts), axis=0)
        end = np.repeat(ends.reshape(-1, 2), len(shifts), axis=0)
        shift = np.tile(shifts, ends.shape[0] * ends.shape[1])[:, None]
        way = np.linalg.norm(end - start, axis=1)
        keep = way > _SHORTEST
        start, shift, way = start[keep], shift[keep], way[keep]
        forth = (end[keep] - start) / way[:, None]
        return cls(start + shift * np.column_stack([-forth[:, 1], forth[:, 0]]), forth, way - _TO_THING)

    def local(self, things: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where things (N, 2) are, seen from each start: along the motion and to its left (C, N) [m]."""
        offset = things[None] - self.start[:, None]
        along = (offset * self.forth[:, None]).sum(axis=-1)
        return along, offset[..., 1] * self.forth[:, None, 0] - offset[..., 0] * self.forth[:, None, 1]

    def run_ups(self, things: FloatArray, workspace: WorkspaceSpec) -> FloatArray:
        """(C,) how far behind its start the hand finds room to go down [m]; infinite where it does not."""
        along, across = self.local(things)
        along = np.where(np.abs(across) < HAND_WIDTH / 2 + _FREE, along, np.inf)
        found = np.full(len(self.length), np.inf)
        for step in range(_BACK_STEPS):
            back = _TO_THING + _FREE / 2 + step * _BACK_STEP
            at = self.start - self.forth * back
            blocked = (np.abs(along + back) < HAND_DEPTH / 2 + _FREE).any(axis=1)
            blocked |= ~workspace.contains(at, _BORDER)
            found = np.where(np.isinf(found) & ~blocked, back, found)
        return found

    def gain(self, things: FloatArray, back: FloatArray, zone: _Zone) -> FloatArray:
        """(C,) in things; minus infinity where the hand cannot go down `back` (C,) [m] behind the start."""
        along, across = self.local(things)
        front = (self.length + _TO_THING)[:, None]
        met = along > -back[:, None]
        caught = met & (np.abs(across) < HAND_WIDTH / 2)
        lane = np.where(caught, np.floor((across / HAND_WIDTH + 0.5) * _LANES), -1.0)
        before = np.zeros_like(along)  # of how many things between it and the hand each is pushed
        for number in range(_LANES):
            rank = np.argsort(np.argsort(np.where(lane == number, along, np.inf), axis=1), axis=1)
            before = np.where(lane == number, rank, before)
        ahead = np.where(caught, np.maximum(along, front + before * _PITCH), along)
        rim = met & (along < front) & (np.abs(np.abs(across) - HAND_WIDTH / 2) < _RIM)
        lost = np.where(rim, _RIM_LOST, np.where(ahead > along, before * _LOST, 0.0))
        left = np.stack([-self.forth[:, 1], self.forth[:, 0]], axis=-1)
        there = self.start[:, None] + ahead[..., None] * self.forth[:, None] + across[..., None] * left[:, None]
        gain = ((1.0 - lost) * zone.worth(there)).sum(axis=1) - zone.worth(things).sum()
        gain -= _PER_METRE * (self.length + np.where(np.isfinite(back), back, 0.0))
        return np.where(np.isfinite(back), gain, -np.inf)
