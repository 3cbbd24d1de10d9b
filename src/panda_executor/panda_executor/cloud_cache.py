"""The newest point cloud, kept as it came until someone needs its points."""

from __future__ import annotations

import threading

from cliport_core import topics
from cliport_core.errors import ImageError
from cliport_core.outcome import Refusal
from cliport_core.raw_header import header_of_raw
from panda_executor.errors import RequestError


def stamp_of_raw(raw: bytes) -> int:
    """Return the stamp [ns] of a serialized message that begins with a std_msgs/Header; 0 when it is too short."""
    try:
        return header_of_raw(raw)[0]
    except ImageError:
        return 0


class CloudCache:
    """Holds one serialized cloud and judges its age; safe between threads.

    Args:
        max_age: an older cloud is not given out [s].
        behind: a cloud may have been taken this much before the observation that a goal comes from [s];
            by default it must show the same scene or a later one.
        max_ahead: nor is one given out that is stamped later than now by more [s].
    """

    def __init__(self, max_age: float = 2.0, behind: float = 0.0, max_ahead: float = 0.25) -> None:
        self._max_age, self._behind, self._max_ahead = max_age, behind, max_ahead
        self._lock = threading.Lock()
        self._raw: bytes | None = None
        self._stamp_ns = 0
        self._complaint, self._complaint_ns = "", 0

    def put(self, raw: bytes) -> None:
        """Take note of a serialized PointCloud2."""
        with self._lock:
            self._raw, self._stamp_ns = raw, stamp_of_raw(raw)

    def complain(self, words: str, stamp_ns: int) -> None:
        """Take note of what perception finds wrong with the camera's data: no older cloud is given out."""
        with self._lock:
            self._complaint, self._complaint_ns = words, stamp_ns

    def age(self, now_ns: int) -> float:
        """Return the age of the newest cloud [s], infinite when there is none."""
        with self._lock:
            return float("inf") if self._raw is None else (now_ns - self._stamp_ns) * 1e-9

    def since(self, now_ns: int, departed_ns: int) -> bytes:
        """Return the newest cloud, serialized, if it was taken after the arm departed at `departed_ns`.

        Raises:
            RequestError: as `get` does.
        """
        raw, stamp_ns = self._fresh(now_ns)
        if stamp_ns < departed_ns:
            early = (departed_ns - stamp_ns) * 1e-9
            words = (
                f"the newest point cloud was taken {early:.1f} s before the arm last departed; has the camera stopped?"
            )
            raise RequestError(words, Refusal.OLD_CLOUD, early, 0.0)
        return raw

    def _complained(self, now_ns: int) -> str:
        """Return the complaint if it is younger than the newest cloud; one from the future is of another clock."""
        return self._complaint if self._stamp_ns < self._complaint_ns <= now_ns + self._max_ahead * 1e9 else ""

    def get(self, now_ns: int, goal_stamp_ns: int, still_since_ns: int) -> bytes:
        """Return the newest cloud, serialized, if it shows the table as it is now.

        Args:
            goal_stamp_ns: of the observation that the goal comes from, 0 when unknown.
            still_since_ns: when the arm last came to rest; before that it stood in the view.

        Raises:
            RequestError: when there is none, or it is too old; says by how much. When perception has complained since.
        """
        raw, stamp_ns = self._fresh(now_ns)
        behind = (goal_stamp_ns - stamp_ns) * 1e-9
        if goal_stamp_ns and behind > self._behind:
            words = (
                f"the point cloud is {behind:.1f} s older than the goal's observation (at most {self._behind:g} s); "
                "raise cloud_behind, or perception's points_rate"
            )
            raise RequestError(words, Refusal.OLD_CLOUD, behind, self._behind)
        if stamp_ns < still_since_ns:
            early = (still_since_ns - stamp_ns) * 1e-9
            words = f"the point cloud was taken while the arm still moved, {early:.1f} s before its last motion's end"
            raise RequestError(f"{words}; raise cloud_wait, or perception's points_rate", Refusal.OLD_CLOUD, early, 0.0)
        return raw

    def _fresh(self, now_ns: int) -> tuple[bytes, int]:
        """Return the newest cloud and its stamp [ns] if it is as old as one may be. Raises RequestError."""
        with self._lock:
            raw, stamp_ns, complaint = self._raw, self._stamp_ns, self._complained(now_ns)
        if complaint:
            raise RequestError(complaint, Refusal.NO_CLOUD)
        if raw is None:
            raise RequestError(
                f"no point cloud has arrived on {topics.POINTS}; is perception running?", Refusal.NO_CLOUD
            )
        age = (now_ns - stamp_ns) * 1e-9
        if age > self._max_age:
            raise RequestError(
                f"the point cloud is {age:.1f} s old (at most {self._max_age:g} s); has the camera stopped?",
                Refusal.OLD_CLOUD,
                age,
                self._max_age,
            )
        if age < -self._max_ahead:
            raise RequestError(
                f"the point cloud is {-age:.1f} s ahead of the clock (at most {self._max_ahead:g} s); "
                "do camera and executor follow one clock?",
                Refusal.FUTURE_CLOUD,
                -age,
                self._max_ahead,
            )
        return raw, stamp_ns
