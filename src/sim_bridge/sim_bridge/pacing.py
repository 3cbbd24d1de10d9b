"""Number of physics steps that are due: simulated time follows wall time, and drops what it cannot catch up with."""

from __future__ import annotations

import math

_SLOW = 0.8  # share of the pace that was asked for below which it is worth a word


class RealTimePacer:
    """Paces steps of `step` s to `factor` times wall time.

    A process that was held up catches up, but by `max_backlog` s of wall time at most: what is older is
    dropped, so that the simulation runs late for a moment instead of ever faster. At most `max_batch` s of
    wall and of simulated time are due at once, so that other work on the thread has its turn: goals above all.
    """

    def __init__(self, step: float, factor: float = 1.0, max_backlog: float = 0.2, max_batch: float = 0.02) -> None:
        """Raise ValueError unless every argument is positive and finite."""
        for name, value in (
            ("step", step),
            ("factor", factor),
            ("max_backlog", max_backlog),
            ("max_batch", max_batch),
        ):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")
        self._wall_step = step / factor
        self._max_backlog = max_backlog
        self._max_batch = max(max_batch / max(factor, 1.0), self._wall_step)
        self._next: float | None = None
        self._dropped = 0.0

    @property
    def dropped(self) -> float:
        """Wall time [s] that was given up so far because the process could not keep up."""
        return self._dropped

    def due(self, now: float) -> int:
        """Return the number of steps to make at wall time `now` [s]; they count as made."""
        if self._next is None:
            self._next = now
        backlog = now - self._next
        if backlog > self._max_backlog:
            self._dropped += backlog - self._max_backlog
            self._next = now - self._max_backlog
            backlog = self._max_backlog
        steps = math.floor(min(backlog, self._max_batch) / self._wall_step + 1e-9)
        self._next += steps * self._wall_step
        return steps

    def delay(self, now: float) -> float:
        """Return how long [s] from `now` until the next step is due; 0 when one is."""
        return 0.0 if self._next is None else max(self._next + self._wall_step - now, 0.0)


class PaceWatch:
    """Compares how simulated time runs with how it was asked to, `factor` times as fast as wall time."""

    def __init__(self, factor: float) -> None:
        self._factor = factor
        self._last: tuple[float, float] | None = None

    def look(self, simulated: float, now: float) -> str | None:
        """Return what to say where time ran too slowly since the last look; at simulated and wall times [s]."""
        last, self._last = self._last, (simulated, now)
        if last is None or now <= last[1]:
            return None
        pace = (simulated - last[0]) / (now - last[1])
        if pace >= _SLOW * self._factor:
            return None
        words = f"simulated time runs {pace:.1f} times as fast as real time, not {self._factor:g} times"
        return f"{words}: this machine is too slow for more; a lower camera_rate asks less of it"
