"""Programs that the station starts, faked: they learn and calibrate only as a test says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from demo_tool.errors import NotNowError


class FakeLessons:
    """Learns only what a test says."""

    def __init__(self) -> None:
        self.data_sets: list[Path] = []
        self.stops, self.closed, self.fault = 0, False, ""

    def begin(
        self, data_set: Path, options: Sequence[str], on_line: Callable[[str], None], on_end: Callable[..., None]
    ) -> None:
        if self.fault:
            raise NotNowError(self.fault)
        self.data_sets.append(data_set)
        self.options = list(options)
        self.on_line, self.on_end = on_line, on_end

    def stop(self) -> None:
        self.stops += 1

    def close(self) -> None:
        self.closed = True


class FakeCalibrations:
    """Calibrates only as a test says."""

    def __init__(self) -> None:
        self.begun: list[list[str]] = []
        self.stops, self.closed, self.fault = 0, False, ""

    def begin(self, options: Sequence[str], on_line: Callable[[str], None], on_end: Callable[[int], None]) -> None:
        if self.fault:
            raise NotNowError(self.fault)
        self.begun.append(list(options))
        self.on_line, self.on_end = on_line, on_end

    def stop(self) -> None:
        self.stops += 1

    def close(self) -> None:
        self.closed = True
