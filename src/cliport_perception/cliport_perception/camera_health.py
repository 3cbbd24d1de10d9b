"""A judgement of the camera's data: fit to act on, or the line that says why not."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import pairwise
from statistics import median

from cliport_perception.errors import PerceptionError


class Level(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class HealthLimits:
    """Limits of what is fit to act on.

    max_age_s: how old a frame may be [s]; min_valid_fraction: share of the workspace that must be seen;
    max_drop_fraction: share of the images that may stay without a partner; max_depth_noise: standard deviation of depth
    on the table at most [m], 0: any.

    Half of the workspace must be seen: in the simulator 0.89 and more are with any task and kind of camera, 0.71 and
    more while the hand is in the way. With less than half, more is guessed than seen.

    Raises:
        PerceptionError: when a limit admits nothing, or everything.
    """

    max_age_s: float = 1.0
    min_valid_fraction: float = 0.5
    max_drop_fraction: float = 0.5
    max_depth_noise: float = 0.005

    def __post_init__(self) -> None:
        if not 0.0 < self.max_age_s < math.inf:
            raise PerceptionError(f"max_age must be positive and finite [s], got {self.max_age_s}")
        for name in ("min_valid_fraction", "max_drop_fraction"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise PerceptionError(f"{name} must be in 0..1, got {getattr(self, name)}")
        if not 0.0 <= self.max_depth_noise < math.inf:
            raise PerceptionError(f"max_depth_noise must be 0 or more and finite [m], got {self.max_depth_noise}")

    @classmethod
    def read(cls, number: Callable[[str, float], float]) -> HealthLimits:
        """Return the limits that `number` gives for a parameter's name and default. Raises PerceptionError."""
        return cls(
            number("max_age", cls.max_age_s),
            number("min_valid_fraction", cls.min_valid_fraction),
            max_depth_noise=number("max_depth_noise", cls.max_depth_noise),
        )

    def of_each(self, count: int) -> HealthLimits:
        """Return the limits for each of `count` cameras: what is seen counts together."""
        return replace(self, min_valid_fraction=self.min_valid_fraction / count)


@dataclass(frozen=True)
class HealthReport:
    """One diagnosis: level, one line, and the figures behind it."""

    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)


_LEAST_ARRIVALS = 4  # before anything is said of a rate


def valid_fraction_fault(fraction: float, least: float) -> str | None:
    """Return why a view with this share of the workspace seen must not be acted on, or None."""
    if fraction >= least:
        return None
    return (
        f"depth is valid in {100 * fraction:.1f} % of the workspace (at least {100 * least:.0f} % needed): is the "
        "camera's view blocked, or the calibration wrong?"
    )


class CameraHealth:
    """Collects what happens to frames and sums it up; all times [ns] are handed in."""

    def __init__(self, topics: dict[str, str], limits: HealthLimits) -> None:
        """Begin with nothing seen. topics: the topic of each stream, for messages."""
        self._topics = topics
        self._limits = limits
        self._seen: set[str] = set()
        self._last_stamp_ns: int | None = None
        self._arrivals: deque[int] = deque(maxlen=20)
        self._fault: str | None = None
        self._age_words: str | None = None  # of the last frame whose age was looked at
        self._is_late = False  # the fault is a frame's age
        self._valid_fraction: float | None = None
        self._depth_noise: float | None = None
        self.served = 0

    def on_message(self, stream: str) -> None:
        """Note that a message of a stream came, whatever it holds."""
        self._seen.add(stream)

    def check_age(self, stamp_ns: int, now_ns: int) -> str | None:
        """Note a matched frame; return why it must not be served, or None when its age is right."""
        if self._arrivals and now_ns < self._arrivals[-1]:
            self._arrivals.clear()
        self._arrivals.append(now_ns)
        self._last_stamp_ns = stamp_ns
        self._age_words = self._age_fault(now_ns)
        return self._age_words

    def check_valid_fraction(self, fraction: float) -> str | None:
        """Note the share of the workspace that a frame shows; return why it must not be served, or None."""
        self._valid_fraction = fraction
        return valid_fraction_fault(fraction, self._limits.min_valid_fraction)

    def check_noise(self, sigma: float | None) -> str | None:
        """Note the standard deviation of depth [m], where it is known; return why nothing must be served, or None."""
        self._depth_noise = sigma
        most = self._limits.max_depth_noise
        if sigma is None or most == 0.0 or sigma <= most:
            return None
        return (
            f"depth has {1e3 * sigma:.1f} mm of noise on the table (at most {1e3 * most:g}): set depth_frames to "
            "average over frames, bring the camera nearer, or look for what disturbs it"
        )

    def on_fault(self, message: str) -> None:
        """Note why a frame could not be served."""
        self._fault = message
        self._is_late = message == self._age_words

    def on_served(self) -> None:
        """Note that a frame was served."""
        self._fault = None
        self.served += 1

    def report(self, now_ns: int, matches: int, drops: int) -> HealthReport:
        """Return the state at `now_ns`; matches and drops are the synchroniser's counts since the last report."""
        values = self._values(now_ns, drops)
        missing = [topic for stream, topic in self._topics.items() if stream not in self._seen]
        if missing:
            return HealthReport(Level.ERROR, f"nothing received on {', '.join(missing)}", values)
        age_fault, slow = self._age_fault(now_ns), self._too_slow(now_ns)
        if self._last_stamp_ns is None:
            names = " and ".join(self._topics.values())
            return HealthReport(Level.ERROR, self._fault or f"stamps of {names} never match", values)
        if slow is not None and self._fault is None:
            return HealthReport(Level.WARN, slow, values)
        if age_fault is not None:
            return HealthReport(Level.STALE, age_fault, values)
        if self._fault is not None:
            return HealthReport(Level.STALE if self._is_late else Level.ERROR, self._fault, values)
        if drops > self._limits.max_drop_fraction * max(1, matches + drops):
            return HealthReport(Level.WARN, f"{drops} images without a partner since the last report", values)
        return HealthReport(Level.OK, "camera data is fresh", values)

    def _age_fault(self, now_ns: int) -> str | None:
        if self._last_stamp_ns is None:
            return None
        age = (now_ns - self._last_stamp_ns) * 1e-9
        if age > self._limits.max_age_s:
            return f"newest camera frame is {age:.1f} s old (limit {self._limits.max_age_s:.1f} s)"
        if age < -self._limits.max_age_s:
            return (
                f"newest camera frame is stamped {-age:.1f} s in the future: "
                "set use_sim_time alike on every node, and synchronise the clocks"
            )
        return None

    def _too_slow(self, now_ns: int) -> str | None:
        """Return what is wrong with a camera whose frames grow too old before the next one comes; None: it is quicker.

        Nor is it slow, but silent, once the next one is overdue by another period.
        """
        arrivals = list(self._arrivals)
        if len(arrivals) < _LEAST_ARRIVALS:
            return None
        period = median(b - a for a, b in pairwise(arrivals)) * 1e-9
        limit = self._limits.max_age_s
        if period < 0.8 * limit or (now_ns - arrivals[-1]) * 1e-9 > 2.0 * period:
            return None
        return (
            f"the camera is slow, a frame every {period:.1f} s, which is too old after {limit:.1f} s: what is seen is "
            "acted on only just after a frame; raise the camera's rate, or max_age"
        )

    def _values(self, now_ns: int, drops: int) -> dict[str, str]:
        values = {"served": str(self.served), "unmatched_images": str(drops)}
        if self._last_stamp_ns is not None:
            values["age_s"] = f"{(now_ns - self._last_stamp_ns) * 1e-9:.3f}"
        if len(self._arrivals) >= 2 and self._arrivals[-1] > self._arrivals[0]:
            rate = (len(self._arrivals) - 1) / ((self._arrivals[-1] - self._arrivals[0]) * 1e-9)
            values["rate_hz"] = f"{rate:.2f}"
        if self._valid_fraction is not None:
            values["valid_fraction"] = f"{self._valid_fraction:.3f}"
        if self._depth_noise is not None:
            values["depth_noise_mm"] = f"{1e3 * self._depth_noise:.2f}"
        return values
