"""Calibrations on file: a camera's YAML with where its numbers come from; written whole, earlier ones kept."""

from __future__ import annotations

import math
import os
import re
import shutil
from dataclasses import dataclass
from datetime import datetime, timezone
from enum import Enum
from pathlib import Path
from typing import Any

import yaml

from cliport_core.whole_file import whole_file
from cliport_perception.calibration.board import Board, board_from_dict
from cliport_perception.calibration.result import EyeOnBase, Misfit, Uncertainty
from cliport_perception.camera_file import CameraCalibration, CameraFileError, camera_of, read_content
from cliport_perception.depth_correction import DepthCorrection
from cliport_perception.errors import CalibrationError

VERSION = 2  # 1 had neither depth nor table_z
_NEEDED = ("version", "made", "method", "base_frame", "camera_frame")
_OPTIONAL = ("board", "samples", "outliers", "fitted", "held_out", "uncertainty")
_SINCE_2 = ("depth", "table_z")


def is_frame_name(text: str) -> bool:
    """Return True if a text can be a frame's name: not empty and without white space."""
    return re.fullmatch(r"\S+", text) is not None


class Method(Enum):
    """Ways to a calibration."""

    EYE_ON_BASE = "eye_on_base"
    FIXED_MARKER = "fixed_marker"
    TOUCHED_POINTS = "touched_points"
    STATIC = "static"


@dataclass(frozen=True, eq=False)
class CalibrationRecord:
    """A camera's calibration and where it comes from.

    made: when, with its time zone. held_out, fitted, uncertainty: None where they were not measured. depth: correction
    of what the depth camera measures; table_z: height at which the table's top is seen then [m, base frame]; None where
    nobody asked for them.

    Raises:
        CalibrationError: when base_frame or camera_frame is no name of a frame, or table_z is no height.
    """

    camera: CameraCalibration
    made: datetime
    method: Method
    base_frame: str
    camera_frame: str
    board: Board | None = None
    samples: int = 0
    outliers: tuple[int, ...] = ()
    fitted: Misfit | None = None
    held_out: Misfit | None = None
    uncertainty: Uncertainty | None = None
    depth: DepthCorrection | None = None
    table_z: float | None = None

    def __post_init__(self) -> None:
        for frame in (self.base_frame, self.camera_frame):
            if not is_frame_name(frame):
                raise CalibrationError(
                    "base_frame and camera_frame must be names of frames, one word each, got "
                    f"{[self.base_frame, self.camera_frame]}"
                )
        if self.table_z is not None and not math.isfinite(self.table_z):
            raise CalibrationError(f"table_z must be a finite number, got {self.table_z}")

    def age_days(self, now: datetime) -> float:
        """Return how old the calibration is [days]."""
        return (now - self.made).total_seconds() / 86400.0

    def to_dict(self) -> dict[str, Any]:
        """Return the file's content as plain values."""
        about: dict[str, Any] = {
            "version": VERSION,
            "made": self.made.astimezone(timezone.utc).isoformat(timespec="seconds"),
            "method": self.method.value,
            "base_frame": self.base_frame,
            "camera_frame": self.camera_frame,
            "samples": self.samples,
            "outliers": list(self.outliers),
        }
        if self.board is not None:
            about["board"] = self.board.to_dict()
        for name in ("fitted", "held_out"):
            misfit = getattr(self, name)
            if misfit is not None:
                about[name] = {key: round(value, 4) for key, value in misfit._asdict().items()}
        if self.uncertainty is not None:
            about["uncertainty"] = {"mm": round(self.uncertainty.mm, 4), "deg": round(self.uncertainty.deg, 5)}
        if self.depth is not None:
            about["depth"] = self.depth.to_dict()
        if self.table_z is not None:
            about["table_z"] = self.table_z
        return {"camera": self.camera.to_dict(), "calibration": about}


def record_of(
    found: EyeOnBase, camera: CameraCalibration, board: Board, frames: tuple[str, str], made: datetime
) -> CalibrationRecord:
    """Return the record of a solved calibration; frames: the base's and the optical one's."""
    return CalibrationRecord(
        camera,
        made,
        Method.EYE_ON_BASE,
        *frames,
        board,
        len(found.samples),
        tuple(found.outliers),
        found.fitted,
        found.held_out,
        found.uncertainty,
    )


def save_calibration(path: Path, record: CalibrationRecord) -> Path | None:
    """Write a calibration, whole or not at all; return where the one that was there before is kept, or None.

    Raises:
        CalibrationError: when the place cannot be written.
    """
    text = "# A camera's calibration: docs/calibration.md. `camera` is also what --camera and camera_mounting take.\n"
    text += yaml.safe_dump(record.to_dict(), sort_keys=False)
    return write_kept(path, text)


def write_kept(path: Path, text: str) -> Path | None:
    """Write a file, whole or not at all; return where the one that was there before is kept, or None.

    Raises:
        CalibrationError: when the place cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
            kept = _keep(path)
    except OSError as error:
        raise CalibrationError(f"cannot write {path}: {error.strerror or error}") from None
    return kept


def _keep(path: Path) -> Path | None:
    """Give the present file a second name that tells when it was written; the first stays until it is replaced."""
    if not path.is_file():
        return None
    written = datetime.fromtimestamp(path.stat().st_mtime, timezone.utc).strftime("%Y%m%dT%H%M%S")
    for number in range(1, 1000):
        kept = path.with_name(f"{path.stem}.{written}{'' if number == 1 else f'-{number}'}{path.suffix}")
        if kept.exists():
            continue
        try:
            os.link(path, kept)
        except FileExistsError:
            continue
        except OSError:  # a file system without second names
            shutil.copy2(path, kept)
        return kept
    raise OSError(f"too many calibrations are kept beside {path.name}")


def load_calibration(path: Path) -> CalibrationRecord:
    """Read a calibration, strictly.

    Raises:
        CalibrationError: when a field is missing, unknown, not finite or makes no rotation; naming it.
    """
    try:
        content = read_content(path)
        camera = camera_of(content, path)
    except CameraFileError as error:
        raise CalibrationError(str(error)) from None
    about = content.get("calibration")
    if not isinstance(about, dict):
        raise CalibrationError(f"{path} holds a camera, but no 'calibration' that says where it comes from")
    names = set(map(str, about))
    known = {*_NEEDED, *_OPTIONAL, *(() if about.get("version") == 1 else _SINCE_2)}
    missing, unknown = [n for n in _NEEDED if n not in names], sorted(names - known)
    if missing or unknown:
        faults = [f"{what} {', '.join(n)}" for what, n in (("lacks", missing), ("has the unknown", unknown)) if n]
        raise CalibrationError(f"{path}: 'calibration' {' and '.join(faults)}")
    if about["version"] not in (1, VERSION):
        raise CalibrationError(f"{path} is of version {about['version']!r}; this program reads versions 1 to {VERSION}")
    try:
        return _record(camera, about)
    except (ValueError, TypeError, KeyError, CalibrationError) as error:
        raise CalibrationError(f"{path}: {error}") from None


def _record(camera: CameraCalibration, about: dict[str, Any]) -> CalibrationRecord:
    made = about["made"] if isinstance(about["made"], datetime) else datetime.fromisoformat(str(about["made"]))
    if made.tzinfo is None:
        raise ValueError(f"made must have a time zone, got {about['made']}")
    misfits = {
        name: Misfit(**_numbers(about, name, Misfit._fields)) for name in ("fitted", "held_out") if name in about
    }
    uncertainty = Uncertainty(**_numbers(about, "uncertainty", ("mm", "deg"))) if "uncertainty" in about else None
    return CalibrationRecord(
        camera,
        made,
        Method(about["method"]),
        str(about["base_frame"]),
        str(about["camera_frame"]),
        board_from_dict(about["board"]) if "board" in about else None,
        int(about.get("samples", 0)),
        tuple(int(i) for i in about.get("outliers", ())),
        misfits.get("fitted"),
        misfits.get("held_out"),
        uncertainty,
        DepthCorrection.from_dict(about["depth"]) if "depth" in about else None,
        float(about["table_z"]) if "table_z" in about else None,
    )


def _numbers(about: dict[str, Any], name: str, keys: tuple[str, ...]) -> dict[str, float]:
    values = about[name]
    if not isinstance(values, dict) or set(values) != set(keys):
        raise ValueError(f"{name} must hold {', '.join(keys)}, got {values!r}")
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ValueError(f"{name}.{key} must be a finite number, got {value!r}")
    return {key: float(values[key]) for key in keys}
