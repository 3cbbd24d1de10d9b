"""ros2 interface show: the definition of a message, service or action, with those nested in it."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ros2cli_small.errors import CommandError
from ros2cli_small.packages import find_prefix

FOLDERS = ("msg", "srv", "action")
_PRIMITIVES = (
    "bool", "byte", "char", "float32", "float64", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64",
    "uint64", "string", "wstring",
)  # fmt: skip
# Leading blanks and comment apart: a type, with its bounds of length, and a name.
_FIELD = re.compile(r"\s*([A-Za-z][\w/]*)(<=\d+)?(\[[^\]]*\])?\s+[A-Za-z]\w*")
_STRING = re.compile(r"\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*'")


def add_parser(verbs: Any) -> None:
    """Add `interface show` to the command line."""
    parser = verbs.add_parser("show", help="Output the interface definition")
    comments = parser.add_mutually_exclusive_group()
    comments.add_argument("--all-comments", action="store_true", help="Show the comments of nested definitions too")
    comments.add_argument("--no-comments", action="store_true", help="Show no comments or whitespace")
    parser.add_argument("type", help="Interface (e.g. 'std_msgs/msg/String'); '-' reads it from standard input")
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Print the definition, nested ones indented below their field."""
    name = sys.stdin.readline().strip() if args.type == "-" else args.type
    for line in definition(name, not args.no_comments, args.all_comments):
        print(line)
    return 0


def definition(name: str, comments: bool, nested_comments: bool, level: int = 0) -> Iterator[str]:
    """Yield the lines of `package/folder/Name` and of what is nested in it."""
    package = name.split("/")[0]
    for line in find_definition(name).read_text().splitlines():
        text = line.rstrip() if comments else _without_comment(line)
        if text or comments:
            yield "\t" * level + text if text else ""
        nested = _nested_type(line, package)
        if nested:
            yield from definition(nested, nested_comments, nested_comments, level + 1)


def find_definition(name: str) -> Path:
    """Return the file that defines an interface."""
    parts = name.split("/")
    if len(parts) != 3 or not all(parts) or parts[1] not in FOLDERS:
        raise CommandError(f"Invalid name '{name}'. Expected 'package/{'|'.join(FOLDERS)}/Name'")
    package, folder, short = parts
    try:
        path = find_prefix(package) / "share" / package / folder / f"{short}.{folder}"
    except CommandError:
        raise CommandError(f"Unknown package '{package}'") from None
    if not path.is_file():
        raise CommandError(f"Could not find the interface '{name}'")
    return path


def _nested_type(line: str, package: str) -> str | None:
    """Return the message that a field's line names, if its type is one."""
    field = _FIELD.match(_without_comment(line))
    if field is None or field[1] in _PRIMITIVES:
        return None
    owner, _, short = field[1].rpartition("/")
    if not owner:
        owner = "std_msgs" if short == "Header" else package
    return f"{owner.removesuffix('/msg')}/msg/{short}"


def _without_comment(line: str) -> str:
    """Return a line up to a `#` that is not in a text."""
    masked = _STRING.sub(lambda text: "_" * len(text[0]), line)
    return line[: masked.index("#")].rstrip() if "#" in masked else line.rstrip()
