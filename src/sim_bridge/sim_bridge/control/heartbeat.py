"""Notices that whoever drives the arm has gone silent."""

from __future__ import annotations

import math


class HeartbeatWatchdog:
    """Watches the heartbeats of a driver while its motion runs.

    `tick` is to be called every `period` s by the thread that also delivers heartbeats. Silence is counted in
    ticks, not in time: when this very process is held up, neither ticks nor heartbeats come in, and a driver
    is not blamed for that. A driver that never sent heartbeats, or none for `memory` s before the motion, is
    not watched.
    """

    def __init__(self, timeout: float, period: float = 0.03, memory: float = 1.0) -> None:
        """Raise ValueError unless the times are positive and `timeout` is longer than `period`."""
        if not 0.0 < period < timeout or memory <= 0.0:
            raise ValueError(f"the heartbeat timeout must be longer than {period} s, got {timeout} s")
        self.timeout = timeout
        self.period = period
        self._memory = memory
        self._silence = math.inf
        self._last_tick: float | None = None
        self._moving = False
        self._watching = False

    def beat(self) -> None:
        """Take note of a heartbeat."""
        self._silence = 0.0
        self._watching = True

    def tick(self, now: float, moving: bool) -> bool:
        """Return True at the first tick at which the driver has been silent too
        long while `moving`; now: wall time [s]."""
        passed = self.period if self._last_tick is None else now - self._last_tick
        self._last_tick = now
        if moving and not self._moving:
            self._watching = self._silence <= self._memory
            self._silence = 0.0 if self._watching else self._silence  # a pause before the motion is no fault
        self._moving = moving
        self._silence += min(passed, 2.0 * self.period)
        if moving and self._watching and self._silence > self.timeout:
            self._watching = False
            return True
        return False
