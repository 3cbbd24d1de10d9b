"""Watch over where the arm is measured: at its ready pose, or away from it."""

from __future__ import annotations

import math
from collections.abc import Mapping


class HomeWatch:
    """Newest measured joints against those of the ready pose; home: joint positions by name, tolerance [rad]."""

    def __init__(self, home: Mapping[str, float], tolerance: float) -> None:
        self._home, self._tolerance = home, tolerance
        self.is_home: bool | None = None  # None while that is not known

    def on_joints(self, positions: Mapping[str, float]) -> None:
        """Take the measured positions by name [rad]; whatever lacks a joint of the arm says nothing."""
        measured = [positions.get(name, math.nan) for name in self._home]
        if not all(map(math.isfinite, measured)):
            self.is_home = None
            return
        pairs = zip(measured, self._home.values(), strict=True)
        self.is_home = all(abs(position - ready) <= self._tolerance for position, ready in pairs)

    def forget(self) -> None:
        """Forget what was measured, as the arm has moved since."""
        self.is_home = None
