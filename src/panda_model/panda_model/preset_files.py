"""Presets read from YAML files: those shipped in `presets/` by name, any other by its path."""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from panda_model.arm import ArmModel, Description
from panda_model.errors import PresetError
from panda_model.hand import HandModel
from panda_model.limits import ARM_DOF, FloatArray, JointLimits, SlowEnds, frozen_array

DEFAULT_PRESET = "panda"
_FOLDER = Path(__file__).parent / "presets"
_FRAMES = ("base", "flange", "hand", "tcp")


def preset_names() -> list[str]:
    """Return the names of the shipped presets, sorted."""
    return sorted(path.stem for path in _FOLDER.glob("*.yaml"))


@lru_cache
def load_preset(name: str = DEFAULT_PRESET) -> ArmModel:
    """Return the shipped preset of that name, or the one in the file of that path (`.yaml`).

    Raises:
        PresetError: on an unknown name, listing the known ones; on a file that describes no arm, naming the key.
    """
    if name.endswith((".yaml", ".yml")):
        return _arm(Path(name).stem, _read(Path(name)), Path(name))
    if name not in preset_names():
        raise PresetError(f"unknown robot '{name}'; known are {', '.join(preset_names())}, or the path of a YAML file")
    path = _FOLDER / f"{name}.yaml"
    return _arm(name, _read(path), path)


def _arm(name: str, content: dict[str, Any], path: Path) -> ArmModel:
    keys = [f.name for f in fields(ArmModel) if f.name not in ("name", "prefix") and not f.name.endswith("_frame")]
    content = {"franka_gripper": "", **content}
    _check_keys(content, [*keys, "frames"], str(path))
    frames = _mapping(content, "frames", _FRAMES, path)
    limits = _mapping(content, "limits", [f.name for f in fields(JointLimits)], path, "slow_ends")
    description = _mapping(content, "description", [f.name for f in fields(Description)], path, "own")
    return ArmModel(
        name=name,
        prefix=str(frames["flange"]).removesuffix("link8"),  # the base may have a name of its own
        arm_joints=_names(content, "arm_joints", ARM_DOF, path),
        finger_joints=_names(content, "finger_joints", 2, path),
        limits=_limits(limits, path),
        torque=_seven(content, "torque", path),
        ready=_seven(content, "ready", path),
        **{f"{key}_frame": str(frames[key]) for key in _FRAMES},
        arm_action=str(content["arm_action"]),
        gripper_action=str(content["gripper_action"]),
        gripper_reports_full_width=_yes_or_no(content, "gripper_reports_full_width", path),
        gripper_reports_stalled=_yes_or_no(content, "gripper_reports_stalled", path),
        description=Description(**{key: str(value) for key, value in description.items()}),
        hand=_hand(content["hand"], path),
        franka_gripper=str(content["franka_gripper"]),
    )


def _limits(content: dict[str, Any], path: Path) -> JointLimits:
    slow_ends = None
    if "slow_ends" in content:
        ends = _mapping(content, "slow_ends", [f.name for f in fields(SlowEnds)], path)
        slow_ends = SlowEnds(**{key: _seven(ends, key, path) for key in ends})
        if (slow_ends.slope <= 0.0).any() or (slow_ends.offset < 0.0).any():
            raise PresetError(f"{path}: slow_ends: slope must be positive and offset 0 or more")
    limits = JointLimits(
        **{key: _seven(content, key, path) for key in content if key != "slow_ends"}, slow_ends=slow_ends
    )
    if (limits.lower >= limits.upper).any():
        raise PresetError(f"{path}: limits: each of lower must be less than that of upper")
    for key in ("velocity", "acceleration", "jerk"):
        if (getattr(limits, key) <= 0.0).any():
            raise PresetError(f"{path}: limits: {key} must be positive, got {content[key]!r}")
    return limits


def _hand(value: Any, path: Path) -> HandModel:
    """Return the hand of a shipped hand's name, or of a mapping of its dimensions."""
    if not isinstance(value, dict):
        file = _FOLDER / "hands" / f"{value}.yaml"
        if not file.is_file():
            known = ", ".join(sorted(p.stem for p in file.parent.glob("*.yaml")))
            raise PresetError(f"{path}: unknown hand '{value}'; known are {known}, or a mapping of its dimensions")
        value, path = _read(file), file
    _check_keys(value, [f.name for f in fields(HandModel)], str(path))
    for key, number in value.items():
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not 0.0 < number < np.inf:
            raise PresetError(f"{path}: {key} must be a positive number, got {number!r}")
    return HandModel(**{key: float(number) for key, number in value.items()})


def _read(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise PresetError(f"cannot read the preset {path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise PresetError(f"the preset {path} is not YAML: {str(error).splitlines()[0]}") from None
    if not isinstance(content, dict):
        raise PresetError(f"the preset {path} must hold a mapping")
    return content


def _check_keys(content: dict[str, Any], expected: list[str] | tuple[str, ...], where: str) -> None:
    missing, unknown = sorted(set(expected) - set(content)), sorted(set(content) - set(expected))
    if missing or unknown:
        faults = [f"{what} {', '.join(keys)}" for what, keys in (("missing", missing), ("unknown", unknown)) if keys]
        raise PresetError(f"{where}: keys {'; '.join(faults)}")


def _mapping(
    content: dict[str, Any], key: str, keys: list[str] | tuple[str, ...], path: Path, optional: str = ""
) -> dict[str, Any]:
    value = content[key]
    if not isinstance(value, dict):
        raise PresetError(f"{path}: {key} must be a mapping of {', '.join(keys)}")
    _check_keys(value, [name for name in keys if name != optional or name in value], f"{path}: {key}")
    return value


def _yes_or_no(content: dict[str, Any], key: str, path: Path) -> bool:
    value = content[key]
    if not isinstance(value, bool):
        raise PresetError(f"{path}: {key} must be true or false, got {value!r}")
    return value


def _names(content: dict[str, Any], key: str, count: int, path: Path) -> tuple[str, ...]:
    value = content[key]
    if not isinstance(value, list) or len(value) != count or len(set(map(str, value))) != count:
        raise PresetError(f"{path}: {key} must be {count} different names, got {value!r}")
    return tuple(map(str, value))


def _seven(content: dict[str, Any], key: str, path: Path) -> FloatArray:
    try:
        values = frozen_array(content[key])
    except (TypeError, ValueError):
        values = frozen_array([np.nan])
    if values.shape != (ARM_DOF,) or not np.isfinite(values).all():
        raise PresetError(f"{path}: {key} must be {ARM_DOF} numbers, one a joint, got {content[key]!r}")
    return values
