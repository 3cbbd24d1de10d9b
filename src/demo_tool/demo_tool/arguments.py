"""Checked arguments of commands, which come from outside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cliport_core.action import Primitive
from cliport_core.errors import InstructionError
from cliport_core.instruction import normalized_instruction
from cliport_episodes.demonstration import PixelBox
from cliport_perception.camera_model import CameraModel
from demo_tool.errors import CommandError


def text_of(arguments: Mapping[str, Any], name: str) -> str:
    """Return a string argument. Raises CommandError."""
    value = arguments.get(name)
    if not isinstance(value, str):
        raise CommandError(f"'{name}' must be a text, got {_shown(value)}")
    return value


def number_of(arguments: Mapping[str, Any], name: str, low: int, high: int) -> int:
    """Return a whole number from low to high. Raises CommandError."""
    value = arguments.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value // 1:
        raise CommandError(f"'{name}' must be a whole number, got {_shown(value)}")
    if not low <= value <= high:
        raise CommandError(f"'{name}' must be {low} to {high}, got {_shown(value)}")
    return int(value)


def verdict_of(arguments: Mapping[str, Any], name: str = "success") -> bool | None:
    """Return True, False or None (not judged). Raises CommandError."""
    value = arguments.get(name)
    if value is not None and not isinstance(value, bool):
        raise CommandError(f"'{name}' must be true, false or null, got {_shown(value)}")
    return value


def instruction_of(arguments: Mapping[str, Any], name: str = "text") -> str:
    """Return an instruction as one line in any script, without doubled blanks; it may be empty. Raises CommandError."""
    try:
        return normalized_instruction(text_of(arguments, name))
    except InstructionError as error:
        raise CommandError(str(error)) from None


def primitive_of(arguments: Mapping[str, Any], name: str = "name") -> Primitive:
    """Return a primitive by its name in small letters. Raises CommandError."""
    value = text_of(arguments, name)
    known = {primitive.name.lower(): primitive for primitive in Primitive}
    if value not in known:
        raise CommandError(f"'{name}' must be one of {', '.join(known)}, got {_shown(value)}")
    return known[value]


def box_of(arguments: Mapping[str, Any], camera: CameraModel) -> PixelBox:
    """Return the argument `box`, [top, left, bottom, right] in pixels of the picture, rounded. Raises CommandError."""
    value = arguments.get("box")
    numbers = isinstance(value, (list, tuple)) and len(value) == 4
    if not numbers or not all(_is_number(v) for v in value):  # type: ignore[union-attr]
        raise CommandError(f"'box' must be [top, left, bottom, right] in pixels, got {_shown(value)}")
    top, left, bottom, right = (round(v) for v in value)  # type: ignore[union-attr]
    if bottom <= top or right <= left:
        raise CommandError(f"the box is empty: {right - left} pixels wide and {bottom - top} high; draw it larger")
    if top < 0 or left < 0 or bottom > camera.height or right > camera.width:
        raise CommandError(
            f"the box (rows {top} to {bottom}, columns {left} to {right}) reaches out of the picture of "
            f"{camera.height} rows and {camera.width} columns"
        )
    return PixelBox(top, left, bottom, right)


def pixel_of(arguments: Mapping[str, Any], camera: CameraModel) -> tuple[int, int]:
    """Return the argument `pixel`, [row, col] of the picture, rounded down. Raises CommandError."""
    value = arguments.get("pixel")
    if not isinstance(value, (list, tuple)) or len(value) != 2 or not all(_is_number(v) for v in value):
        raise CommandError(f"'pixel' must be [row, col] of the picture, got {_shown(value)}")
    row, col = (int(v // 1) for v in value)
    if not (0 <= row < camera.height and 0 <= col < camera.width):
        raise CommandError(
            f"the pixel ({row}, {col}) is not in the picture of {camera.height} rows and {camera.width} columns"
        )
    return row, col


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e6


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
