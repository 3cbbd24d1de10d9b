"""The end of every way to a calibration: it is saved, and said where and what was kept."""

from __future__ import annotations

from pathlib import Path

from cliport_perception.calibration.calibration_file import CalibrationRecord, save_calibration

DEFAULT_OUT = Path("calibration/camera.yaml")


def say_saved(path: Path, record: CalibrationRecord) -> int:
    """Save a calibration and say what was kept; return the exit status. Raises CalibrationError."""
    kept = save_calibration(path, record)
    x, y, z = record.camera.camera_in_base.translation
    print(f"{path}: {record.camera_frame} at {x:.4f}, {y:.4f}, {z:.4f} m in {record.base_frame}")
    if kept is not None:
        print(f"the calibration that was there is kept as {kept}")
    return 0
