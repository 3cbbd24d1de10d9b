"""ros2 bag record: write what is published into a bag."""

from __future__ import annotations

import argparse
import re
import signal
import time
from pathlib import Path
from typing import Any

from ros2cli_small.bag.info import STORAGE_NAMES as STORAGES
from ros2cli_small.errors import CommandError

MINIMUM_FILE_SIZE = 86016  # bytes; the real command's, from SQLite's pages


def add_parser(verbs: Any) -> None:
    """Add `bag record` to the command line."""
    parser = verbs.add_parser("record", help="Record ROS data to a bag")
    named = parser.add_mutually_exclusive_group()
    named.add_argument(
        "topics_positional", nargs="*", default=[], metavar="topic", help="Topics to record (deprecated)"
    )
    named.add_argument("--topics", nargs="+", default=[], metavar="topic", help="Space-delimited list of topics")
    parser.add_argument("-a", "--all", action="store_true", help="Record all topics but hidden ones")
    parser.add_argument("--all-topics", action="store_true", help="The same: services are not recorded here")
    parser.add_argument("-e", "--regex", default="", help="Record topics containing this regular expression")
    parser.add_argument(
        "-o", "--output", help="Destination of the bag to create, defaults to a timestamped folder in the current one"
    )
    parser.add_argument("-s", "--storage", default="mcap", choices=STORAGES, help="Storage identifier (default: mcap)")
    parser.add_argument(
        "-b",
        "--max-bag-size",
        type=int,
        default=0,
        metavar="BYTES",
        help="Size at which a file ends and the next begins",
    )
    parser.add_argument(
        "-d", "--max-bag-duration", type=int, default=0, metavar="SECONDS",
        help="Duration at which a file ends and the next begins",
    )  # fmt: skip
    parser.add_argument("--use-sim-time", action="store_true", help="Stamp messages with the time on /clock")
    parser.add_argument("--qos-profile-overrides-path", metavar="FILE", help="YAML file of QoS profiles by topic")
    parser.add_argument("--custom-data", nargs="*", default=[], metavar="KEY=VALUE", help="Kept in the bag's metadata")
    parser.set_defaults(main=main)


def main(args: argparse.Namespace) -> int:
    """Record until Ctrl-C or SIGTERM, both of which are a clean end."""
    if not (args.all or args.all_topics or args.regex or args.topics or args.topics_positional):
        raise CommandError("[ERROR] [ros2bag]: Must specify --topics, --all, --all-topics or --regex")
    if 0 < args.max_bag_size < MINIMUM_FILE_SIZE or min(args.max_bag_size, args.max_bag_duration) < 0:
        raise CommandError(f"[ERROR] [ros2bag]: Files split at {MINIMUM_FILE_SIZE} bytes or more, and 1 s or more")
    folder = Path(args.output or time.strftime("rosbag2_%Y_%m_%d-%H_%M_%S"))
    if folder.exists():
        raise CommandError(f"[ERROR] [ros2bag]: Output folder '{folder}' already exists.")
    custom_data = _custom_data(args.custom_data)
    regex = _regex(args.regex)

    from ros2cli_small.bag.qos import read_overrides
    from ros2cli_small.bag.recorder import Recorder, Selection
    from ros2cli_small.bag.writer import BagWriter, SplitLimits
    from ros2cli_small.graph import command_node, full_name

    overrides = read_overrides(args.qos_profile_overrides_path)
    ended = False

    def end(_number: int, _frame: Any) -> None:
        nonlocal ended
        ended = True

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    with command_node(args.use_sim_time, "rosbag2_recorder") as node:
        names = frozenset(full_name(node, name) for name in (*args.topics, *args.topics_positional))
        limits = SplitLimits(args.max_bag_size, args.max_bag_duration * 10**9)
        writer = BagWriter(folder, args.storage, limits, custom_data)
        Recorder(node, writer, Selection(names, args.all or args.all_topics, regex), overrides).run(lambda: ended)
    return 0


def _custom_data(entries: list[str]) -> dict[str, str]:
    wrong = [entry for entry in entries if "=" not in entry]
    if wrong:
        raise CommandError(f"[ERROR] [ros2bag]: Custom data '{wrong[0]}' is not KEY=VALUE")
    return dict(entry.split("=", 1) for entry in entries)


def _regex(text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise CommandError(f"[ERROR] [ros2bag]: '{text}' is no regular expression: {error}") from None
