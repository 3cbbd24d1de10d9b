"""The newest joint positions, whatever order they come in, and whether the arm stands still."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence

import numpy as np

from panda_executor.errors import PortError
from panda_model.limits import FloatArray

_STILL_SPEED = 0.02  # a joint slower than this stands still [rad/s]
_STILL_SPAN_NS = 80_000_000  # over which that is measured
_REORDERED_NS = 200_000_000  # a joint's position that is older by more was stamped by a clock that was set back


class JointTracker:
    """Keeps what joint state messages say of the arm and the fingers; safe between threads.

    Args:
        arm_joints, finger_joints: names; a message may hold others, or only some of these.
        max_age: older positions are not given out [s]; max_ahead: nor those stamped later than now by more [s].
    """

    def __init__(
        self, arm_joints: Sequence[str], finger_joints: Sequence[str], max_age: float = 0.5, max_ahead: float = 0.25
    ) -> None:
        self._arm_joints, self._finger_joints = tuple(arm_joints), tuple(finger_joints)
        self._max_age, self._max_ahead = max_age, max_ahead
        self._lock = threading.Lock()
        self._seen: dict[str, tuple[float, int]] = {}
        self._track: deque[tuple[int, FloatArray]] = deque(maxlen=250)  # (stamp, the arm's positions), by time
        self._changed_ns: int | None = None
        self._distrusted = False

    def update(self, names: Sequence[str], positions: Sequence[float], stamp_ns: int) -> None:
        """Take note of a message: positions [rad, m] by name, and its stamp; what is not finite says nothing."""
        with self._lock:
            for name, position in zip(names, positions):
                known = name in self._arm_joints or name in self._finger_joints
                if known and math.isfinite(position) and not self._is_overtaken(name, stamp_ns):
                    self._seen[name] = (float(position), stamp_ns)
            oldest_ns = self._arm_stamp_ns()
            if oldest_ns is not None:
                self._note(np.array([self._seen[name][0] for name in self._arm_joints]), oldest_ns)

    def _is_overtaken(self, name: str, stamp_ns: int) -> bool:
        """Return True if a newer position of the joint came before this one."""
        return name in self._seen and 0 < self._seen[name][1] - stamp_ns <= _REORDERED_NS

    def _arm_stamp_ns(self) -> int | None:
        """Return the oldest of the arm joints' stamps; None before each was seen."""
        if any(name not in self._seen for name in self._arm_joints):
            return None
        return min(self._seen[name][1] for name in self._arm_joints)

    def arm_stamp_ns(self) -> int | None:
        """Return the stamp of what is known of the arm: its oldest joint's; None before each was seen."""
        with self._lock:
            return self._arm_stamp_ns()

    def _note(self, arm: FloatArray, stamp_ns: int) -> None:
        if not self._track or not np.array_equal(arm, self._track[-1][1]):
            self._changed_ns, self._distrusted = stamp_ns, False
        if self._track and stamp_ns < self._track[-1][0]:
            self._track.clear()  # the clock was set back
        if not self._track or stamp_ns > self._track[-1][0]:
            self._track.append((stamp_ns, arm))

    def age(self, now_ns: int) -> float:
        """Return the age of the oldest joint that is needed [s]; infinite when one was never seen."""
        needed = (*self._arm_joints, *self._finger_joints[:1])
        with self._lock:
            if any(name not in self._seen for name in needed):
                return float("inf")
            return (now_ns - min(self._seen[name][1] for name in needed)) * 1e-9

    def unchanged(self, now_ns: int) -> float:
        """Return for how long [s] the arm's positions were the same to the last bit; infinite when none came.

        A driver that stamps old values anew is found out by this: an arm that moves changes them.
        """
        with self._lock:
            return float("inf") if self._changed_ns is None else (now_ns - self._changed_ns) * 1e-9

    def distrust(self) -> None:
        """Believe no standstill until the positions change: they stayed the same during a motion."""
        with self._lock:
            self._distrusted = True

    def is_still(self, now_ns: int) -> bool:
        """Return True if fresh positions show the arm at rest."""
        with self._lock:
            track, distrusted = list(self._track), self._distrusted
        if distrusted or len(track) < 2:
            return False
        newest = track[-1][0]
        if not -self._max_ahead <= (now_ns - newest) * 1e-9 <= self._max_age:
            return False
        first = len(track) - 2
        while first > 0 and newest - track[first - 1][0] <= _STILL_SPAN_NS:
            first -= 1
        span = (newest - track[first][0]) * 1e-9
        if span > self._max_age:  # between these two the clock jumped ahead, or the states were lost
            return False
        way = np.ptp(np.array([positions for _, positions in track[first:]]), axis=0)
        return bool((way <= _STILL_SPEED * span).all())

    def arm_positions(self, now_ns: int) -> FloatArray:
        """Return the arm's positions (7,) [rad].

        Raises:
            PortError: when a joint was never seen, not lately, or in the future.
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
        if age < -self._max_ahead:
            raise PortError(
                f"the position of joint '{name}' is {-age:.1f} s ahead of the clock (at most {self._max_ahead:g} s); "
                "do driver and executor follow one clock?"
            )
        return seen[0]
