"""Definitions of a bag's message types, so that it can be read where they are not installed."""

from __future__ import annotations

import json
from pathlib import Path

from ros2cli_small.errors import CommandError
from ros2cli_small.packages import find_share

SEPARATOR = "\n" + "=" * 80 + "\nMSG: {}\n"


def type_definition(name: str) -> str:
    """Return the text of `package/msg/Name` and of all types in it; empty for types without a file, as of actions."""
    try:
        own = _share_file(name, "json").read_text()
        nested = [item["type_name"] for item in json.loads(own)["type_description_msg"]["referenced_type_descriptions"]]
        texts = {each: _share_file(each, "msg").read_text() for each in [name, *nested]}
    except (CommandError, OSError):
        return ""
    text = texts.pop(name)
    for each, definition in texts.items():
        package, _, short = each.split("/")
        text += SEPARATOR.format(f"{package}/{short}") + definition
    return text


def _share_file(name: str, suffix: str) -> Path:
    package, folder, short = name.split("/")
    return find_share(package) / folder / f"{short}.{suffix}"
