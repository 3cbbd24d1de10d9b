"""Check of the camera's pictures: whether they are fresh enough to act on."""

from __future__ import annotations

from collections import deque

from demo_tool.live_view import LiveView
from demo_tool.station_config import StationConfig

BEFORE_REST = "the picture was taken before the arm came to rest: the next one follows"
_MAX_PLAUSIBLE_AGE = 1e5  # a larger age means that clocks differ [s]
_MIN_RATE_SPAN = 0.3  # shortest span for a rate [s]
_CLOCK_RESET_NS = 10_000_000_000  # ROS time this far before the arm's rest was set back [ns]


class CameraWatch:
    """Newest view of the camera, its age and its problem; now_ns: ROS time [ns]; wall: a steady clock's time [s]."""

    def __init__(self, config: StationConfig) -> None:
        self._config = config
        self.view: LiveView | None = None
        self.fault = ""  # why pictures that come cannot be used
        self._arrivals: deque[float] = deque(maxlen=16)
        self._rest_ns = 0  # when the arm came to rest

    def on_view(self, view: LiveView, wall: float) -> None:
        """Take a new picture."""
        self.view, self.fault = view, ""
        self._arrivals.append(wall)

    def on_rest(self, now_ns: int) -> None:
        """Note that the arm came to rest: older pictures show it in motion, or the scene before."""
        self._rest_ns = now_ns + int(self._config.settle * 1e9)

    def age(self, now_ns: int) -> float:
        """Return the age of the newest picture [s]; infinite when there is none."""
        return float("inf") if self.view is None else (now_ns - self.view.stamp_ns) * 1e-9

    def rate(self, wall: float) -> float:
        """Return the recent rate of pictures [1/s]."""
        if len(self._arrivals) < 2 or wall - self._arrivals[-1] > self._config.silence:
            return 0.0
        span = self._arrivals[-1] - self._arrivals[0]
        return (len(self._arrivals) - 1) / span if span > _MIN_RATE_SPAN else 0.0

    def problem(self, now_ns: int, wall: float) -> str | None:
        """Return one line that says why nothing can be drawn on the picture, or None; it has no count that runs."""
        if self.view is None:
            return self.fault or "no picture has come yet: is the camera running?"
        silence = wall - self._arrivals[-1]
        if silence > self._config.silence:
            return self.fault or "the camera sends no picture: is it running?"
        age = self.age(now_ns)
        if abs(age) > _MAX_PLAUSIBLE_AGE or age < -self._config.max_age:
            return "the camera's clock and this station's differ: set use_sim_time alike on every node"
        if age > self._config.max_age:
            return self.fault or f"the picture is older than {self._config.max_age:g} s: is the camera running?"
        if self.view.stamp_ns < self._rest_ns <= now_ns + _CLOCK_RESET_NS:
            return BEFORE_REST
        return None
