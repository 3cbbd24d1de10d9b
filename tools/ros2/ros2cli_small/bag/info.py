"""ros2 bag info: what is in a bag."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ros2cli_small.bag.reader import Bag

INDENT = " " * 19


def add_parser(verbs: Any) -> None:
    """Add `bag info` to the command line."""
    parser = verbs.add_parser("info", help="Print information about a bag to the screen")
    add_bag_arguments(parser)
    parser.set_defaults(main=main)


def add_bag_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what names the bag to read."""
    parser.add_argument("bag_path", type=Path, help="Bag to open")
    parser.add_argument("-s", "--storage", help="Storage identifier of the bag, by default found out: mcap or sqlite3")


def main(args: argparse.Namespace) -> int:
    """Print the summary."""
    from ros2cli_small.bag.reader import open_bag

    with open_bag(args.bag_path, args.storage) as bag:
        print(summary(bag))
    return 0


def summary(bag: Bag) -> str:
    """Return what the real command prints."""
    topics = [
        f"Topic: {topic.name} | Type: {topic.type} | Count: {topic.count} | Serialization Format: {topic.encoding}"
        for topic in bag.topics.values()
    ]
    rows = {
        "Files:": f"\n{INDENT}".join(file.name for file in bag.files),
        "Bag size:": _size(sum(file.stat().st_size for file in bag.files)),
        "Storage id:": bag.storage,
        "ROS Distro:": bag.ros_distro,
        "Duration:": f"{_seconds(bag.end - bag.start)}s",
        "Start:": _moment(bag.start),
        "End:": _moment(bag.end),
        "Messages:": bag.message_count,
        "Topic information:": f"\n{INDENT}".join(topics),
    }
    return "\n" + "\n".join(f"{title:<19}{value}" for title, value in rows.items())


def _size(size: float) -> str:
    units = iter(("B", "KiB", "MiB", "GiB", "TiB"))
    unit = next(units)
    while size >= 1024 and unit != "TiB":
        size, unit = size / 1024, next(units)
    return f"{size:.0f} B" if unit == "B" else f"{size:.1f} {unit}"


def _seconds(nanoseconds: int) -> str:
    return f"{nanoseconds // 10**9}.{nanoseconds % 10**9:09d}"


def _moment(nanoseconds: int) -> str:
    local = time.strftime("%b %e %Y %H:%M:%S", time.localtime(nanoseconds // 10**9))
    return f"{local}.{nanoseconds % 10**9:09d} ({_seconds(nanoseconds)})"
