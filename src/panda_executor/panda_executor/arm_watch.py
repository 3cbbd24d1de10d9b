"""The demands on an arm that moves."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ArmWatch:
    """Demands on an arm that moves.

    path_tolerance: how far a joint may be off its path [rad]; goal_tolerance: off its end [rad]; goal_time: how late
    it may settle there [s]; standstill_time: for it to be measured at rest afterwards, wall clock [s]; frozen: joint
    states that stay the same to the last bit for so long while the path goes on are not measured [s]; frozen_way: the
    path's way in that time from which on they must change [rad].
    """

    path_tolerance: float = 0.2
    goal_tolerance: float = 0.01
    goal_time: float = 1.0
    standstill_time: float = 1.5
    frozen: float = 0.4
    frozen_way: float = 0.02
