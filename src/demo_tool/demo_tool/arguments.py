"""Arguments of commands, as they come from outside: taken only when they are what they should be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cliport_episodes.demonstration import PixelBox
from cliport_episodes.errors import InstructionError
from cliport_episodes.names import check_instruction
from cliport_perception.camera_model import CameraModel
from cliport_perception.primitive import Primitive
from demo_tool.errors import CommandError


def text_of(arguments: Mapping[str, Any], name: str) -> str:
    """A string. Raises CommandError."""
    value = arguments.get(name)
    if not isinstance(value, str):
        raise CommandError(f"'{name}' must be a text, got {_shown(value)}")
    return value


def number_of(arguments: Mapping[str, Any], name: str, low: int, high: int) -> int:
    """A whole number of low..high. Raises CommandError."""
    value = arguments.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value // 1:
        raise CommandError(f"'{name}' must be a whole number, got {_shown(value)}")
    if not low <= value <= high:
        raise CommandError(f"'{name}' must be {low} to {high}, got {_shown(value)}")
    return int(value)


def verdict_of(arguments: Mapping[str, Any], name: str = "success") -> bool | None:
    """True, False or None (not said). Raises CommandError."""
    value = arguments.get(name)
    if value is not None and not isinstance(value, bool):
        raise CommandError(f"'{name}' must be true, false or null, got {_shown(value)}")
    return value


def instruction_of(arguments: Mapping[str, Any], name: str = "text") -> str:
    """One line in any script, without doubled blanks; it may be empty. Raises CommandError."""
    value = text_of(arguments, name)
    if not value.strip():
        return ""
    try:
        return " ".join(check_instruction(value).split())
    except InstructionError as error:
        raise CommandError(str(error)) from None


def primitive_of(arguments: Mapping[str, Any], name: str = "name") -> Primitive:
    """By its name in small letters. Raises CommandError."""
    value = text_of(arguments, name)
    known = {primitive.name.lower(): primitive for primitive in Primitive}
    if value not in known:
        raise CommandError(f"'{name}' must be one of {', '.join(known)}, got {_shown(value)}")
    return known[value]


def box_of(arguments: Mapping[str, Any], camera: CameraModel) -> PixelBox:
    """A box of the picture, [top, left, bottom, right] in pixels, rounded. Raises CommandError."""
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


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e6


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
