"""The end of every way to a calibration: it is saved, and said where and what was kept."""

from __future__ import annotations

import os
from pathlib import Path

from cliport_perception.calibration.calibration_file import CalibrationRecord, save_calibration
from cliport_perception.errors import CalibrationError

DEFAULT_OUT = Path("calibration/camera.yaml")


def check_writable(path: Path) -> None:
    """Refuse a place where a calibration could not be saved, before the work is done; nothing is written.

    Raises:
        CalibrationError: naming what is in the way.
    """
    if path.is_dir():
        raise CalibrationError(f"cannot write {path}: it is a folder; give --out a file's name")
    folder = path.absolute().parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise CalibrationError(f"cannot write {path}: {folder} is a file; give another --out")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise CalibrationError(f"cannot write {path}: {folder} may not be written to; give another --out")


def say_saved(path: Path, record: CalibrationRecord) -> int:
    """Save a calibration and say what was kept; return the exit status. Raises CalibrationError."""
    kept = save_calibration(path, record)
    x, y, z = record.camera.camera_in_base.translation
    print(f"{path}: {record.camera_frame} at {x:.4f}, {y:.4f}, {z:.4f} m in {record.base_frame}")
    if kept is not None:
        print(f"the calibration that was there is kept as {kept}")
    return 0
