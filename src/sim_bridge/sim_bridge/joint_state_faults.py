"""Faults of joint states on their way: they are lost, late, early, or old ones with new stamps."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from sim_bridge.panda import ArmState

SHIFT_S = 1.0  # of stamps that are wrong


class StateFault(Enum):
    """The faults of joint states."""

    LOST = "lost"
    OLD = "old"
    AHEAD = "ahead"
    RESTAMPED = "restamped"

    @property
    def words(self) -> str:
        """A clause that says what the joint states are like."""
        return {
            StateFault.LOST: "no joint states are published",
            StateFault.OLD: f"joint states are stamped {SHIFT_S:g} s too early",
            StateFault.AHEAD: f"joint states are stamped {SHIFT_S:g} s too late",
            StateFault.RESTAMPED: "joint states repeat the last one with new stamps",
        }[self]


class JointStateFaults:
    """Spoils joint states.

    Args:
        is_on: whether a fault is wanted now.
    """

    def __init__(self, is_on: Callable[[StateFault], bool]) -> None:
        self._is_on = is_on
        self._kept: ArmState | None = None

    @property
    def any(self) -> bool:
        """True while joint states are not what they should be."""
        return any(self._is_on(fault) for fault in StateFault)

    def spoiled(self, time: float, state: ArmState) -> tuple[float, ArmState] | None:
        """Return stamp [s] and state as they are to be published, None where nothing is."""
        if not self._is_on(StateFault.RESTAMPED) or self._kept is None:
            self._kept = state
        if self._is_on(StateFault.LOST):
            return None
        shift = SHIFT_S * (self._is_on(StateFault.AHEAD) - self._is_on(StateFault.OLD))
        return time + shift, self._kept
