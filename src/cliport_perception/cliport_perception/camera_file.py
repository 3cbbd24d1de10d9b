"""A camera on file: where it stands, and how its lens and sensor map the scene to pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from cliport_core.pose import Pose
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CameraModelError, PerceptionError

_NEAREST = 1e-3  # two points that are closer give no direction [m]
_UNIT = 0.01  # by which an orientation's length may differ from 1
_SIZE, _LENS = ("width", "height"), ("fx", "fy", "cx", "cy")
_DISTORTION = ("distortion_model", "distortion")
_KEYS = ("position", "looking_at", "orientation_xyzw", *_SIZE, *_LENS, *_DISTORTION)


class CameraFileError(PerceptionError):
    """A file that does not describe a camera; the message names it and what it must hold."""


@dataclass(frozen=True)
class CameraCalibration:
    """A calibrated camera: its lens and image size, and the pose of its optical frame (z forward) in the base."""

    intrinsics: CameraModel
    camera_in_base: Pose

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for YAML or JSON; the content of `camera:` in a file that `read_camera` reads."""
        lens = self.intrinsics
        values: dict[str, Any] = {
            "position": self.camera_in_base.translation.tolist(),
            "orientation_xyzw": self.camera_in_base.as_quaternion_xyzw().tolist(),
            **{name: getattr(lens, name) for name in (*_SIZE, *_LENS)},
        }
        if lens.is_distorted:
            values |= {"distortion_model": lens.distortion_model, "distortion": list(lens.distortion)}
        return values


def read_camera(file: Path, default_lens: CameraModel | None = None) -> CameraCalibration:
    """Return the camera that a YAML file describes under `camera:`.

    Args:
        file: it holds `position: [x, y, z]` and either `looking_at: [x, y, z]` (image upright) or
            `orientation_xyzw: [x, y, z, w]` of the optical frame [m, base frame]; and `width`, `height`, `fx`, `fy`,
            `cx`, `cy` [pixels], with `distortion_model` and `distortion` as in CameraInfo where the lens distorts.
        default_lens: of a file without those numbers; None: they are needed.

    Raises:
        CameraFileError: when the file cannot be read or holds something else.
    """
    return camera_of(read_content(file), file, default_lens)


def camera_of(content: dict[str, Any], file: Path, default_lens: CameraModel | None = None) -> CameraCalibration:
    """Return what `read_camera` does of a file's content. Raises CameraFileError, naming the file."""
    camera = content["camera"]
    if unknown := sorted(set(map(str, camera)) - set(_KEYS)):
        raise CameraFileError(f"{file}: unknown keys {unknown} of 'camera'; valid are {', '.join(_KEYS)}")
    return CameraCalibration(_intrinsics(camera, file, default_lens), _pose(camera, file))


def read_content(file: Path) -> dict[str, Any]:
    """Return a file's whole content, a camera under `camera` in it.

    Raises:
        CameraFileError: when the file cannot be read or describes no camera.
    """
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise CameraFileError(f"cannot read the camera's mounting {file}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise CameraFileError(f"the camera's mounting {file} is not YAML: {str(error).splitlines()[0]}") from None
    found: dict[str, Any] = content if isinstance(content, dict) else {}
    camera = found.get("camera")
    if not isinstance(camera, dict) or "position" not in camera or not {"looking_at", "orientation_xyzw"} & set(camera):
        raise CameraFileError(
            f"the camera's mounting {file} must hold 'camera' with 'position' and 'looking_at' (or 'orientation_xyzw')"
        )
    return found


def _pose(camera: dict[str, Any], file: Path) -> Pose:
    position = _numbers(camera, "position", file, ("x", "y", "z"), " [m]")
    if "looking_at" in camera and "orientation_xyzw" in camera:
        raise CameraFileError(f"{file}: give 'looking_at' or 'orientation_xyzw', not both")
    if "orientation_xyzw" in camera:
        quaternion = _numbers(camera, "orientation_xyzw", file, ("x", "y", "z", "w"))
        if abs(math.hypot(*quaternion) - 1.0) > _UNIT:
            raise CameraFileError(
                f"{file}: orientation_xyzw must be a unit quaternion, got one of length {math.hypot(*quaternion):.3g}"
            )
        return Pose.from_quaternion_xyzw(quaternion, position)
    target = _numbers(camera, "looking_at", file, ("x", "y", "z"), " [m]")
    if math.dist(position, target) < _NEAREST:
        raise CameraFileError(f"{file}: the camera looks at where it stands; move one of 'position' and 'looking_at'")
    return Pose.looking_at((position[0], position[1], position[2]), (target[0], target[1], target[2]))


def _intrinsics(camera: dict[str, Any], file: Path, default_lens: CameraModel | None) -> CameraModel:
    missing = [name for name in (*_SIZE, *_LENS) if name not in camera]
    if missing:
        if len(missing) < len(_SIZE + _LENS) or any(name in camera for name in _DISTORTION):
            raise CameraFileError(f"{file}: 'camera' lacks {', '.join(missing)} [pixels]; give all of them or none")
        if default_lens is None:
            raise CameraFileError(f"{file}: 'camera' lacks the lens: {', '.join(missing)} [pixels]")
        return default_lens
    size = [_number(camera, name, file) for name in _SIZE]
    if any(value != round(value) for value in size):
        raise CameraFileError(f"{file}: width and height must be whole numbers of pixels, got {size}")
    fx, fy, cx, cy = (_number(camera, name, file) for name in _LENS)
    model = camera.get("distortion_model", "plumb_bob")
    try:
        coefficients = tuple(float(value) for value in camera.get("distortion", ()))
        return CameraModel(round(size[0]), round(size[1]), fx, fy, cx, cy, str(model), coefficients)
    except (TypeError, ValueError):
        raise CameraFileError(
            f"{file}: distortion must be a list of numbers, got {camera.get('distortion')!r}"
        ) from None
    except CameraModelError as error:
        raise CameraFileError(f"{file}: {error}") from None


def _numbers(camera: dict[str, Any], key: str, file: Path, names: tuple[str, ...], unit: str = "") -> tuple[float, ...]:
    try:
        values = tuple(float(v) for v in camera[key])
    except (TypeError, ValueError):
        values = ()
    if len(values) != len(names) or not all(map(math.isfinite, values)):
        count, listed = {3: "three", 4: "four"}[len(names)], f"{', '.join(names[:-1])} and {names[-1]}"
        raise CameraFileError(f"{file}: {key} must be {count} numbers, {listed}{unit}, got {camera[key]!r}")
    return values


def _number(camera: dict[str, Any], key: str, file: Path) -> float:
    value = camera[key]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise CameraFileError(f"{file}: {key} must be a finite number [pixels], got {value!r}")
    return float(value)
