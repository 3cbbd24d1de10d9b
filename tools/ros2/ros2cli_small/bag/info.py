"""ros2 bag info: what is in a bag."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ros2cli_small.bag.reader import Bag, BagTopic

INDENT = " " * 19
STORAGE_NAMES = ("mcap", "sqlite3")
SORTING = ("name", "type", "count")
SERVICE_TOPIC, SERVICE_TYPE = "/_service_event", "_Event"


def add_parser(verbs: Any) -> None:
    """Add `bag info` to the command line."""
    parser = verbs.add_parser("info", help="Print information about a bag to the screen")
    add_bag_arguments(parser)
    parser.add_argument("-t", "--topic-name", action="store_true", help="Only display topic names")
    parser.add_argument("--sort", choices=SORTING, default="name", help="Order of topics (default: name)")
    parser.set_defaults(main=main)


def add_bag_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what names the bag to read."""
    parser.add_argument("bag_path", type=existing_path, help="Bag to open")
    parser.add_argument("-s", "--storage", choices=STORAGE_NAMES, help="Storage of the bag, by default found out")


def existing_path(text: str) -> Path:
    """Read the path of a bag that must be there."""
    if not Path(text).exists():
        raise argparse.ArgumentTypeError(f"Bag path '{text}' does not exist!")
    return Path(text)


def main(args: argparse.Namespace) -> int:
    """Print the summary, or the topics' names alone."""
    from ros2cli_small.bag.reader import open_bag

    with open_bag(args.bag_path, args.storage) as bag:
        if args.topic_name:
            for topic in _in_order(bag, args.sort):
                if not _is_service(topic):
                    print(topic.name)
        else:
            print(summary(bag, args.sort))
    return 0


def summary(bag: Bag, sort: str = "name") -> str:
    """Return what the real command prints."""
    topics = [
        f"Topic: {topic.name} | Type: {topic.type} | Count: {topic.count} | Serialization Format: {topic.encoding}"
        for topic in _in_order(bag, sort)
        if not _is_service(topic)
    ]
    services = [
        f"Service: {topic.name.removesuffix(SERVICE_TOPIC)} | Type: {topic.type.removesuffix(SERVICE_TYPE)} "
        f"| Event Count: {topic.count} | Serialization Format: {topic.encoding}"
        for topic in _in_order(bag, sort)
        if _is_service(topic)
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
        "Service:": len(services),
        "Service information: ": f"\n{INDENT}  ".join(services),
    }
    return "\n" + "\n".join(f"{title:<19}{value}" for title, value in rows.items())


def _in_order(bag: Bag, sort: str) -> list[BagTopic]:
    keys: dict[str, Callable[[BagTopic], Any]] = {
        "name": lambda topic: topic.name,
        "type": lambda topic: topic.type,
        "count": lambda topic: topic.count,
    }
    return sorted(bag.topics.values(), key=keys[sort])


def _is_service(topic: BagTopic) -> bool:
    """Whether a topic has the requests and responses of a service."""
    return topic.name.endswith(SERVICE_TOPIC) and topic.type.endswith(SERVICE_TYPE) and "/srv/" in topic.type


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
