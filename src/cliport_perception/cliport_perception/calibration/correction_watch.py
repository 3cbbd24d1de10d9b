"""The depth correction of a calibration file, followed as the file changes."""

from __future__ import annotations

import math
from datetime import datetime, timezone
from pathlib import Path

from cliport_perception.calibration.calibration_watch import CalibrationWatch
from cliport_perception.depth_correction import AS_MEASURED, DepthCorrection
from cliport_perception.errors import UnfitFrameError


class CorrectionWatch:
    """Knows how one camera's depth is to be corrected.

    path: of its calibration; empty: its depth is taken as it is.
    """

    def __init__(self, path: str) -> None:
        """Read the file. Raises CalibrationError when it cannot be used."""
        self._path = path
        self._watch = None
        if path:
            self._watch = CalibrationWatch(Path(path), math.inf, lambda: datetime.now(timezone.utc))

    def poll(self) -> None:
        """Read the file again if it has changed; one that cannot be used leaves the last good one in force."""
        if self._watch is not None:
            self._watch.poll()

    @property
    def table_z(self) -> float | None:
        """Height of the table's top in the base frame [m] that the file gives, or None."""
        return None if self._watch is None else self._watch.record.table_z

    def of_frame(self, frame_id: str) -> DepthCorrection:
        """Return the correction of depth in an optical frame.

        Raises:
            UnfitFrameError: when the file corrects another camera's depth.
        """
        record = None if self._watch is None else self._watch.record
        if record is None or record.depth is None:
            return AS_MEASURED
        if record.camera_frame != frame_id:
            raise UnfitFrameError(
                f"{self._path} corrects the depth of '{record.camera_frame}', and images come in '{frame_id}': give "
                "this camera's own calibration"
            )
        return record.depth
