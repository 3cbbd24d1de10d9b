"""A lens as a file in the form that ROS camera drivers read as camera_info_url."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from cliport_perception.calibration.calibration_file import write_kept
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError, CameraModelError

_NEEDED = ("image_width", "image_height", "camera_matrix", "distortion_model", "distortion_coefficients")


def write_lens(path: Path, camera: CameraModel, name: str = "camera") -> Path | None:
    """Write a camera_info file; return the name under which the one that was there is kept, None where there was none.

    Raises:
        CalibrationError: when the file cannot be written.
    """
    projection = np.hstack([camera.matrix, np.zeros((3, 1))])
    content = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": _matrix(camera.matrix),
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": _matrix(np.array([camera.distortion])),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(projection),
    }
    return write_kept(path, yaml.safe_dump(content, sort_keys=False))


def read_lens(path: Path) -> CameraModel:
    """Read a camera_info file, strictly.

    Raises:
        CalibrationError: when it cannot be read, or a field is missing or not finite; naming it.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        raise CalibrationError(f"cannot read {path}: {reason}") from None
    except yaml.YAMLError:
        raise CalibrationError(f"{path} is no YAML") from None
    missing = [name for name in _NEEDED if not isinstance(content, dict) or name not in content]
    if missing:
        raise CalibrationError(f"{path} lacks {', '.join(missing)}: give a file as camera_info_url names one")
    k = _numbers(path, content, "camera_matrix", (9,))
    d = _numbers(path, content, "distortion_coefficients", (0, 4, 5, 8, 12, 14))
    width, height = (_whole(path, content, name) for name in ("image_width", "image_height"))
    try:
        return CameraModel(width, height, k[0], k[4], k[2], k[5], str(content["distortion_model"]), tuple(d))
    except CameraModelError as error:
        raise CalibrationError(f"{path}: {error}") from None


def _matrix(values: np.ndarray) -> dict[str, Any]:
    return {"rows": values.shape[0], "cols": values.shape[1], "data": [float(v) for v in values.ravel()]}


def _numbers(path: Path, content: dict[str, Any], name: str, lengths: tuple[int, ...]) -> list[float]:
    matrix = content[name]
    data = matrix.get("data") if isinstance(matrix, dict) else None
    try:
        numbers = [float(value) for value in data or ()]
    except (TypeError, ValueError):
        numbers = [float("nan")]
    if not isinstance(data, list) or len(numbers) not in lengths or not np.isfinite(numbers).all():
        wanted = " or ".join(map(str, lengths))
        raise CalibrationError(f"{path}: {name}.data must be {wanted} finite numbers, got {data!r}")
    return numbers


def _whole(path: Path, content: dict[str, Any], name: str) -> int:
    value = content[name]
    if isinstance(value, bool) or not isinstance(value, int):
        raise CalibrationError(f"{path}: {name} must be a whole number of pixels, got {value!r}")
    return value
