"""The command line: groups and verbs, and what becomes of errors."""

from __future__ import annotations

import argparse
import os
import signal
import sys

from ros2cli_small import launch, run, service_call, topic_echo, topic_hz, topic_list, topic_pub
from ros2cli_small.bag import info as bag_info
from ros2cli_small.bag import play as bag_play
from ros2cli_small.bag import record as bag_record
from ros2cli_small.errors import CommandError


def build_parser() -> argparse.ArgumentParser:
    """Return the parser; each verb's module adds its own arguments and sets `main`."""
    parser = argparse.ArgumentParser(prog="ros2", description="ros2 is a command-line tool for ROS 2.")
    commands = parser.add_subparsers(title="Commands", metavar="command")
    run.add_parser(commands)
    launch.add_parser(commands)

    topic = commands.add_parser("topic", help="Various topic related sub-commands")
    topic.set_defaults(group=topic)
    verbs = topic.add_subparsers(title="Commands", metavar="verb")
    for verb in (topic_echo, topic_hz, topic_list, topic_pub):
        verb.add_parser(verbs)

    bag = commands.add_parser("bag", help="Various rosbag related sub-commands")
    bag.set_defaults(group=bag)
    bag_verbs = bag.add_subparsers(title="Commands", metavar="verb")
    for bag_verb in (bag_info, bag_play, bag_record):
        bag_verb.add_parser(bag_verbs)

    service = commands.add_parser("service", help="Various service related sub-commands")
    service.set_defaults(group=service)
    service_call.add_parser(service.add_subparsers(title="Commands", metavar="verb"))
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit status: 0, 1 for an error, 2 for wrong usage or Ctrl-C."""
    parser = build_parser()
    args = parser.parse_args(argv)
    verb = getattr(args, "main", None)
    if verb is None:
        getattr(args, "group", parser).print_help()
        return 0
    # A shell ignores Ctrl-C for what it starts in the background, and that is inherited: a signal sent on purpose
    # must end the command all the same.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return int(verb(args))
    except KeyboardInterrupt:
        return int(signal.SIGINT)
    except CommandError as error:
        print(error, file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader of our output is gone, as in `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
