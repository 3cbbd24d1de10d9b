"""The second pair of eyes on the arm: what must never go on without an owner is cancelled from outside its process."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum


class Fault(Enum):
    """The reasons for which everything is cancelled at the controllers."""

    EXECUTOR_SILENT = "the executor gives no sign of work done"
    JOINT_STATES_LOST = "the joint states ended while the arm moved"
    JOINT_STATES_OLD = "the joint states are older than they may be"
    JOINT_STATES_AHEAD = "the joint states are ahead of the clock"


@dataclass(frozen=True)
class GuardConfig:
    """Settings of the guard; times [s] of a steady clock unless they say otherwise.

    silence: the longest between two signs of work done while the arm moves; joint_silence: between two joint states;
    max_age, max_ahead: of a joint state's stamp [s, ROS time]; moving: the arm moves while a joint goes at least so far
    [rad, m] within still_for; repeat: between two cancels of one fault.
    """

    silence: float = 0.2
    joint_silence: float = 0.3
    max_age: float = 0.5
    max_ahead: float = 0.25
    moving: float = 0.0005
    still_for: float = 0.3
    repeat: float = 0.5


class Guard:
    """Decides when to cancel everything. Silence is counted in ticks, so that its own pauses blame nobody.

    `tick` is to be called every `period` s by the thread that also delivers what is heard.

    Args:
        arm_joints: all of these must be heard of for the joint states to go on; empty: any message will do.
    """

    def __init__(self, config: GuardConfig | None = None, period: float = 0.02, arm_joints: Sequence[str] = ()) -> None:
        self.config, self._period = config or GuardConfig(), period
        self._arm_joints = frozenset(arm_joints)
        self._awaited = set(self._arm_joints)  # not heard of since the joint states last counted as whole
        self._last_tick: float | None = None
        self._since_beat = math.inf
        self._since_joints = math.inf
        self._since_motion = math.inf
        self._since_cancel = math.inf
        self._heard = False
        self._positions: dict[str, float] = {}
        self._age = 0.0

    def on_heartbeat(self) -> None:
        """Note a sign of work done by the executor."""
        self._since_beat, self._heard = 0.0, True

    def on_joints(self, names: Sequence[str], positions: Sequence[float], age: float) -> None:
        """Note a joint state: positions [rad, m] by name, and the age of its stamp [s]."""
        for name, position in zip(names, positions):
            if not math.isfinite(position):
                continue
            self._awaited.discard(name)
            # Compared with where it last counted as moving: from one message to the next a fast driver's joint hardly
            # changes at any speed.
            if abs(position - self._positions.setdefault(name, position)) > self.config.moving:
                self._positions[name] = position
                self._since_motion = 0.0
        if not self._awaited:
            self._awaited = set(self._arm_joints)
            self._since_joints, self._age = 0.0, age

    @property
    def moving(self) -> bool:
        """True while the arm or the fingers move, as far as was heard."""
        return self._since_motion < self.config.still_for

    def tick(self, now: float) -> Fault | None:
        """Return the fault for which everything is to be cancelled at steady time `now` [s], or None."""
        passed = self._period if self._last_tick is None else now - self._last_tick
        self._last_tick = now
        passed = min(passed, 2.0 * self._period)
        self._since_beat += passed
        self._since_joints += passed
        self._since_cancel += passed
        if self._since_joints < self.config.joint_silence:
            self._since_motion += passed  # what moved when the states ended is taken to move on
        fault = self._fault()
        if fault is None or self._since_cancel < self.config.repeat:
            return None
        self._since_cancel = 0.0
        return fault

    def _fault(self) -> Fault | None:
        """Return what is wrong while the arm moves; an executor that was never heard is not watched."""
        config = self.config
        if not self.moving or not self._heard:
            return None
        if self._since_beat > config.silence:
            return Fault.EXECUTOR_SILENT
        if self._since_joints >= config.joint_silence:
            return Fault.JOINT_STATES_LOST
        if self._age > config.max_age:
            return Fault.JOINT_STATES_OLD
        return Fault.JOINT_STATES_AHEAD if self._age < -config.max_ahead else None
