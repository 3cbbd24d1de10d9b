"""Calibrations in the format of easy_handeye2: a YAML file of `parameters` and `transform`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from cliport_core.pose import Pose
from cliport_perception.calibration.calibration_file import write_kept
from cliport_perception.errors import CalibrationError

_UNIT = 0.01  # by which an orientation's length may differ from 1


class EasyHandeye(NamedTuple):
    """The part of such a file that counts here: a camera that stands beside the arm."""

    name: str
    robot_base_frame: str
    robot_effector_frame: str
    tracking_base_frame: str
    tracking_marker_frame: str
    camera_in_base: Pose


def write_easy_handeye(path: Path, calibration: EasyHandeye) -> Path | None:
    """Write a calibration for easy_handeye2's publisher; return where an earlier file is kept, or None.

    Raises:
        CalibrationError: when the place cannot be written.
    """
    x, y, z = (float(v) for v in calibration.camera_in_base.translation)
    qx, qy, qz, qw = (float(v) for v in calibration.camera_in_base.as_quaternion_xyzw())
    content = {
        "parameters": {
            "name": calibration.name,
            "calibration_type": "eye_on_base",
            "robot_base_frame": calibration.robot_base_frame,
            "robot_effector_frame": calibration.robot_effector_frame,
            "tracking_base_frame": calibration.tracking_base_frame,
            "tracking_marker_frame": calibration.tracking_marker_frame,
            "freehand_robot_movement": True,
            "move_group_namespace": "/",
            "move_group": "manipulator",
        },
        "transform": {"translation": {"x": x, "y": y, "z": z}, "rotation": {"x": qx, "y": qy, "z": qz, "w": qw}},
    }
    return write_kept(path, yaml.safe_dump(content, sort_keys=False))


def read_easy_handeye(path: Path) -> EasyHandeye:
    """Read a calibration of easy_handeye2.

    Raises:
        CalibrationError: when the file cannot be read, is of a camera in the hand, or holds no rotation.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CalibrationError(f"cannot read {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise CalibrationError(f"{path} is not YAML: {str(error).splitlines()[0]}") from None
    parameters = content.get("parameters") if isinstance(content, dict) else None
    transform = content.get("transform") if isinstance(content, dict) else None
    if not isinstance(parameters, dict) or not isinstance(transform, dict):
        raise CalibrationError(f"{path} must hold 'parameters' and 'transform', as easy_handeye2 writes them")
    kind = parameters.get("calibration_type")
    if kind != "eye_on_base":
        raise CalibrationError(f"{path}: calibration_type is {kind!r}; only eye_on_base is read")
    texts = {name: _text(parameters, name, path) for name in EasyHandeye._fields[:-1]}
    shift = _numbers(transform, "translation", "xyz", path)
    turn = _numbers(transform, "rotation", "xyzw", path)
    if abs(math.hypot(*turn) - 1.0) > _UNIT:
        raise CalibrationError(f"{path}: rotation must be a unit quaternion, got one of length {math.hypot(*turn):.3g}")
    return EasyHandeye(camera_in_base=Pose.from_quaternion_xyzw(turn, shift), **texts)


def _text(parameters: dict[str, Any], name: str, path: Path) -> str:
    value = parameters.get(name)
    if not isinstance(value, str) or not value:
        raise CalibrationError(f"{path}: 'parameters' lacks {name}")
    return value


def _numbers(transform: dict[str, Any], name: str, keys: str, path: Path) -> list[float]:
    values = transform.get(name)
    if not isinstance(values, dict) or set(values) != set(keys):
        raise CalibrationError(f"{path}: {name} must hold {', '.join(keys)}, got {values!r}")
    for key in keys:
        value = values[key]
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise CalibrationError(f"{path}: {name}.{key} must be a finite number, got {value!r}")
    return [float(values[key]) for key in keys]
