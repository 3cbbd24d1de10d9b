"""The newest joint positions, whatever order they come in."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

import numpy as np

from panda_executor.errors import PortError
from panda_model.limits import FloatArray


class JointTracker:
    """Keeps what joint state messages say of the arm and the fingers; safe between threads.

    Args:
        arm_joints, finger_joints: names; a message may hold others, or only some of these.
        max_age: older positions are not given out [s].
    """

    def __init__(self, arm_joints: Sequence[str], finger_joints: Sequence[str], max_age: float = 0.5) -> None:
        self._arm_joints, self._finger_joints = tuple(arm_joints), tuple(finger_joints)
        self._max_age = max_age
        self._lock = threading.Lock()
        self._seen: dict[str, tuple[float, int]] = {}

    def update(self, names: Sequence[str], positions: Sequence[float], stamp_ns: int) -> None:
        """Take note of a message: positions [rad, m] by name, and its stamp; what is not finite says nothing."""
        with self._lock:
            for name, position in zip(names, positions):
                if math.isfinite(position) and (name in self._arm_joints or name in self._finger_joints):
                    self._seen[name] = (float(position), stamp_ns)

    def age(self, now_ns: int) -> float:
        """Return the age of the oldest joint that is needed [s]; infinite when one was never seen."""
        needed = (*self._arm_joints, *self._finger_joints[:1])
        with self._lock:
            if any(name not in self._seen for name in needed):
                return float("inf")
            return (now_ns - min(self._seen[name][1] for name in needed)) * 1e-9

    def arm_positions(self, now_ns: int) -> FloatArray:
        """Return the arm's positions (7,) [rad].

        Raises:
            PortError: when a joint was never seen or not lately.
        """
        return np.array([self._fresh(name, now_ns) for name in self._arm_joints])

    def width(self, now_ns: int) -> float:
        """Return the full distance between the fingers [m]: each finger's joint is half of it.

        Raises:
            PortError: as `arm_positions`.
        """
        with self._lock:
            known = [name for name in self._finger_joints if name in self._seen]
        if not known:
            raise PortError(f"joint '{self._finger_joints[0]}' is not in the joint states")
        return 2.0 * float(np.mean([self._fresh(name, now_ns) for name in known]))

    def _fresh(self, name: str, now_ns: int) -> float:
        with self._lock:
            seen = self._seen.get(name)
        if seen is None:
            raise PortError(f"joint '{name}' is not in the joint states; is the arm's driver running?")
        age = (now_ns - seen[1]) * 1e-9
        if age > self._max_age:
            raise PortError(
                f"the position of joint '{name}' is {age:.1f} s old (at most {self._max_age:g} s); "
                "is the arm's driver running?"
            )
        return seen[0]
