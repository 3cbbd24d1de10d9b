"""A calibration file under watch: read again when it changes, and judged by its age."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from cliport_perception.calibration.calibration_file import CalibrationRecord, load_calibration
from cliport_perception.camera_health import HealthReport, Level
from cliport_perception.errors import CalibrationError


class CalibrationWatch:
    """Keeps the newest calibration that could be read.

    path: of the file. max_age_days: older ones are worth a warning. now: the present time, with its zone.
    """

    def __init__(self, path: Path, max_age_days: float, now: Callable[[], datetime]) -> None:
        """Read the file. Raises CalibrationError when it or max_age_days cannot be used."""
        if not max_age_days > 0.0:
            raise CalibrationError(f"max_age_days must be positive, got {max_age_days}")
        self._path = path
        self._max_age_days = max_age_days
        self._now = now
        self._stamp = self._changed_at()
        self._fault: str | None = None
        self.record = load_calibration(path)

    def poll(self) -> CalibrationRecord | None:
        """Return the calibration when the file has changed and can be used, else None."""
        stamp = self._changed_at()
        if stamp == self._stamp:
            return None
        self._stamp = stamp
        try:
            self.record = load_calibration(self._path)
        except CalibrationError as error:
            self._fault = str(error)
            return None
        self._fault = None
        return self.record

    def report(self, camera_age_s: float | None) -> HealthReport:
        """Return the state of the calibration; camera_age_s: of the newest camera_info, None before the first."""
        age = self.record.age_days(self._now())
        values = {
            "calibration_age_days": f"{age:.2f}",
            "method": self.record.method.value,
            "camera_age_s": "never" if camera_age_s is None else f"{camera_age_s:.2f}",
        }
        if self.record.uncertainty is not None:
            values["uncertainty_mm"] = f"{self.record.uncertainty.mm:.2f}"
            values["uncertainty_deg"] = f"{self.record.uncertainty.deg:.3f}"
        if self._fault is not None:
            return HealthReport(Level.ERROR, f"the last good calibration stays in use: {self._fault}", values)
        if age < 0.0:
            return HealthReport(Level.WARN, "the calibration is of the future: check the clock", values)
        if age > self._max_age_days:
            words = f"the calibration is {age:.0f} days old (limit {self._max_age_days:.0f}): verify or repeat it"
            return HealthReport(Level.WARN, words, values)
        return HealthReport(Level.OK, f"the calibration is {age:.1f} days old", values)

    def _changed_at(self) -> tuple[int, int] | None:
        try:
            state = self._path.stat()
        except OSError:
            return None
        return state.st_mtime_ns, state.st_ino
