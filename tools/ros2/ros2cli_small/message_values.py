"""Messages from YAML values, and messages as YAML or CSV."""

from __future__ import annotations

import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import yaml

from ros2cli_small.errors import CommandError

NOT_A_DICTIONARY = "The passed value needs to be a dictionary in YAML format"


@dataclass(frozen=True)
class Shortening:
    """Limits to the length of printed values. `length` None prints everything."""

    length: int | None = 128
    no_arrays: bool = False
    no_strings: bool = False


def parse_values(text: str) -> dict[str, Any]:
    """Read the values of a message from the command line."""
    try:
        values = yaml.safe_load(text)
    except yaml.YAMLError:
        raise CommandError(NOT_A_DICTIONARY) from None
    if not isinstance(values, dict):
        raise CommandError(NOT_A_DICTIONARY)
    return values


def fill_message(message: Any, values: dict[str, Any], now: Callable[[], Any] | None = None) -> None:
    """Set a message's fields from nested values.

    `now` returns the time as a builtin_interfaces Time; with it a header may be 'auto' and a time 'now'.
    """
    types = message.get_fields_and_field_types()
    for name, value in values.items():
        if name not in types:
            kind = type(message).__name__
            raise CommandError(f"Failed to populate field: '{kind}' object has no attribute '{name}'")
        try:
            setattr(message, name, _convert(types[name], getattr(message, name), value, now))
        except (AssertionError, AttributeError, TypeError, ValueError) as error:
            raise CommandError(f"Failed to populate field: {error}") from None


def _convert(kind: str, current: Any, value: Any, now: Callable[[], Any] | None) -> Any:
    if now and kind == "std_msgs/Header" and value == "auto":
        current.stamp = now()
        return current
    if now and kind == "builtin_interfaces/Time" and value == "now":
        return now()
    element = _element_type(kind)
    if element is not None:
        if not isinstance(value, (list, tuple, bytes, str)) or (isinstance(value, str) and element != "octet"):
            raise CommandError(f"Failed to populate field: a sequence is needed for {kind}, not {value!r}")
        if "/" in element:
            return [_nested(element, item, now) for item in value]
        if isinstance(current, array.array):
            return array.array(current.typecode, value)
        return [_primitive(element, item) for item in value]
    if "/" in kind:
        if not isinstance(value, dict):
            raise CommandError(f"Failed to populate field: {kind} needs a dictionary, not {value!r}")
        fill_message(current, value, now)
        return current
    return _primitive(kind, value)


def _nested(kind: str, value: Any, now: Callable[[], Any] | None) -> Any:
    from ros2cli_small.graph import load_type

    item = load_type(kind, "message")()
    if not isinstance(value, dict):
        raise CommandError(f"Failed to populate field: {kind} needs a dictionary, not {value!r}")
    fill_message(item, value, now)
    return item


def _element_type(kind: str) -> str | None:
    if kind.startswith("sequence<"):
        return kind[len("sequence<") : -1].split(",")[0]
    if kind.endswith("]"):
        return kind[: kind.index("[")]
    return None


def _primitive(kind: str, value: Any) -> Any:
    if kind in ("float", "double"):
        return float(value)
    if kind == "boolean":
        return bool(value)
    if kind == "octet":
        return value if isinstance(value, bytes) else bytes([value])
    if kind.startswith(("string", "wstring")):
        return str(value)
    return int(value)


def to_plain(value: Any, shortening: Shortening) -> Any:
    """Return a message, or a part of one, as dictionaries, lists and plain values, shortened."""
    if hasattr(value, "get_fields_and_field_types"):
        fields = value.get_fields_and_field_types()
        return {name: _plain_field(kind, getattr(value, name), shortening) for name, kind in fields.items()}
    return _plain_field("", value, shortening)


def _plain_field(kind: str, value: Any, shortening: Shortening) -> Any:
    limit = shortening.length
    if isinstance(value, str):
        if shortening.no_strings:
            return f"<string length: <{len(value)}>>"
        return value if limit is None or len(value) <= limit else value[:limit] + "..."
    if isinstance(value, bytes):
        return [int(byte) for byte in value] if len(value) != 1 else value[0]
    if hasattr(value, "get_fields_and_field_types"):
        return to_plain(value, shortening)
    if hasattr(value, "tolist") or isinstance(value, (list, tuple)):
        if shortening.no_arrays:
            element = _element_type(kind) or "?"
            name = "array" if kind.endswith("]") else "sequence"
            return f"<{name} type: {element}, length: {len(value)}>"
        items = value if limit is None else value[:limit]
        items = items.tolist() if hasattr(items, "tolist") else items
        plain = [_plain_field("", item, shortening) for item in items]
        return plain if len(plain) == len(value) else [*plain, "..."]
    return value


def to_yaml(value: Any, shortening: Shortening, flow_style: bool = False) -> str:
    """Return a message, or a field of one, as YAML that ends with a line break."""
    plain = to_plain(value, shortening)
    text: str = yaml.safe_dump(
        plain, sort_keys=False, allow_unicode=True, width=float("inf"), default_flow_style=flow_style
    )
    return text.removesuffix("...\n")  # YAML's end mark after a bare value


def to_csv(value: Any, shortening: Shortening) -> str:
    """Return all values of a message, or of a field of one, in one line."""
    return ",".join(str(leaf) for leaf in _leaves(to_plain(value, shortening)))


def _leaves(plain: Any) -> Iterator[Any]:
    if isinstance(plain, dict):
        plain = list(plain.values())
    if isinstance(plain, list):
        for item in plain:
            yield from _leaves(item)
    else:
        yield plain
