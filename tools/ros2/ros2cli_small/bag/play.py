"""ros2 bag play: publish what a bag holds."""

from __future__ import annotations

import argparse
import math
import signal
from typing import Any

from ros2cli_small.bag.info import add_bag_arguments
from ros2cli_small.errors import CommandError

CLOCK_RATE = 40.0  # Hz


def add_parser(verbs: Any) -> None:
    """Add `bag play` to the command line."""
    parser = verbs.add_parser("play", help="Play back ROS data from a bag")
    add_bag_arguments(parser)
    parser.add_argument("-r", "--rate", type=positive, default=1.0, help="Rate at which to play back messages")
    parser.add_argument("--topics", nargs="+", default=[], metavar="topic", help="Topics to play, by default all")
    parser.add_argument("--qos-profile-overrides-path", metavar="FILE", help="YAML file of QoS profiles by topic")
    parser.add_argument("-l", "--loop", action="store_true", help="Start again at the end, until Ctrl-C")
    parser.add_argument(
        "-m", "--remap", nargs="+", default=[], metavar="old:=new", help="Topics to publish under other names"
    )
    parser.add_argument(
        "--clock", type=positive, nargs="?", const=CLOCK_RATE, default=None, metavar="HZ",
        help=f"Publish the bag's time on /clock, at a frequency in Hz (default: {CLOCK_RATE:g})",
    )  # fmt: skip
    parser.add_argument("-d", "--delay", type=nonnegative, default=0.0, help="Seconds to wait before play (each loop)")
    parser.add_argument(
        "--start-offset", type=nonnegative, default=0.0, metavar="SECONDS",
        help="Start this far into the bag; latched topics' messages from before come first",
    )  # fmt: skip
    parser.add_argument(
        "--playback-duration", type=float, default=-1.0, metavar="SECONDS",
        help="Bag time to play; negative, the default, is all",
    )  # fmt: skip
    parser.add_argument("-p", "--start-paused", action="store_true", help="Start paused")
    parser.add_argument("--disable-keyboard-controls", action="store_true", help="Do not pause and resume with SPACE")
    parser.set_defaults(main=main)


def positive(text: str) -> float:
    """Read a rate or a frequency."""
    value = float(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"Value {text} is not greater than zero")
    return value


def nonnegative(text: str) -> float:
    """Read a duration in seconds."""
    value = float(text)
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"Value {text} is less than zero")
    return value


def main(args: argparse.Namespace) -> int:
    """Play to the end, or until Ctrl-C or SIGTERM."""
    from ros2cli_small.bag.player import Player
    from ros2cli_small.bag.qos import read_overrides
    from ros2cli_small.bag.reader import open_bag
    from ros2cli_small.graph import command_node

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    overrides = read_overrides(args.qos_profile_overrides_path)
    for rule in args.remap:
        old, separator, new = rule.partition(":=")
        if not (old and separator and new):
            raise CommandError(f"Remapping '{rule}' is not 'old:=new'")
    with open_bag(args.bag_path, args.storage) as bag:
        span = _span(args, bag.start, bag.end)
        with command_node(name="rosbag2_player", remappings=args.remap) as node:
            player = Player(node, bag, args.topics, overrides, args.rate, args.start_paused, args.clock)
            player.run(span, args.delay, args.loop, keyboard=not args.disable_keyboard_controls)
    return 0


def _span(args: argparse.Namespace, first: int, last: int) -> tuple[int, int]:
    """Return from when, and to before when, is played."""
    start = first + round(args.start_offset * 1e9)
    if start > last:
        raise CommandError(
            f"--start-offset {args.start_offset:g} is past the end: the bag lasts {(last - first) * 1e-9:.3f} s"
        )
    if args.playback_duration < 0.0:
        return start, last + 1
    return start, min(last + 1, start + round(args.playback_duration * 1e9))
